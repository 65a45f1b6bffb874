//! Names that files bring along.

use ser_evidence::history::Collector;
use ser_evidence::site::Site;

use crate::error::{advise, warn};

/// Inputs of a recorder that are told one by one; further ones are only counted.
const TOLD: usize = 3;

/// Adds to the site what files say of recorders and inputs that it does not name. What files name
/// differently is told.
pub(super) fn take_over(collector: &Collector, site: &mut Site) {
    let differing = collector.name_inputs(site);
    for found in differing.iter().take(TOLD) {
        let (used, other) = (&found.used, &found.other);
        warn(format_args!(
            "{}: one file calls input {} {:?} and another {:?}; {:?} is shown",
            found.recorder, used.input, used.name, other.name, used.name
        ));
    }
    if differing.len() > TOLD {
        warn(format_args!("{} more inputs with two names", differing.len() - TOLD));
    }
    if !differing.is_empty() {
        advise("import all files of one recorder at once, or with the same --map");
    }
}
