//! Records in the archive that `SER_ARCHIVE` names, beside everything else that is known of a
//! recorder.

use std::time::Duration;

use ser_archive::{Access, Archive, Batch, Place};
use ser_evidence::record::Told;
use ser_evidence::site::Site;
use ser_observer::{Author, host_reading};

use crate::archive::Versions;
use crate::error::{Failure, warn};
use crate::output::PROGRAM;
use crate::unit_name::UnitName;

/// The variable that names the archive.
const VARIABLE: &str = "SER_ARCHIVE";

/// How long a command waits for others that write to the archive.
const PATIENCE: Duration = Duration::from_secs(2);

/// Adds a record to the archive, if there is one. Returns whether it is there; if it cannot be,
/// that is told, and the state directory takes it.
pub(super) fn add(told: &Told) -> bool {
    let Some(place) = std::env::var(VARIABLE).ok().filter(|place| !place.is_empty()) else {
        return false;
    };
    match place.parse().map_err(|error: ser_archive::NoPlace| error.to_string()) {
        Ok(place) => match try_add(&place, told) {
            Ok(()) => return true,
            Err(failure) => warn(format_args!(
                "what was done is not in the archive, but in the state directory: {}",
                failure.message()
            )),
        },
        Err(error) => warn(format_args!("{VARIABLE}: {error}")),
    }
    false
}

fn try_add(place: &Place, told: &Told) -> Result<(), Failure> {
    // Only who collects makes archives.
    Archive::open(place, Access::Read)?;
    let mut archive = Archive::open(place, Access::Write { program: PROGRAM })?;
    archive.set_patience(PATIENCE)?;
    // A command that was given a port has no other name for the recorder.
    let site = Versions::of(&mut archive)?.newest();
    let recorder = site.and_then(|site| named(&site, &told.recorder));
    let recorder = recorder.unwrap_or_else(|| told.recorder.clone());
    let now = host_reading::now().utc;
    archive.append(&[Batch::of(collector(), recorder, vec![told.record.clone()], now)])?;
    Ok(())
}

/// The recorder of the site with this name, or at the port of this name.
pub(crate) fn named(site: &Site, recorder: &str) -> Option<String> {
    let is_at_port = |port: &str| {
        let endpoint = port.parse().ok();
        endpoint.is_some_and(|endpoint| UnitName::of(port, &endpoint).name == recorder)
    };
    let known = site
        .recorders
        .iter()
        .find(|known| known.name == recorder || known.port.as_deref().is_some_and(is_at_port));
    known.map(|known| known.name.clone())
}

/// How commands that are not a collector's are called in an archive: by the computer.
pub(crate) fn collector() -> String {
    format!("cli/{}", Author::of_this_program(PROGRAM).host())
}
