//! Commands that were written down in the state directory, moved to the archive.

use std::path::Path;

use ser_archive::{Archive, Batch};
use ser_evidence::record::Told;
use ser_evidence::site::Site;
use ser_observer::host_reading;

use crate::audit;
use crate::error::{Result, inform};

/// Writes commands that could not be archived to the state directory, from where the next run takes
/// them.
pub(super) fn keep(commands: &[Told], state: Option<&Path>) {
    commands.iter().for_each(|told| audit::keep(told, state));
}

/// Adds all commands to recorders of the site that are on record in the state directory. What is in
/// the archive already changes nothing there, and the files stay as they are.
pub(super) fn take_over(archive: &mut Archive, site: &Site, state: Option<&Path>) -> Result<()> {
    let since = audit::since(state, None)?;
    let (collector, now) = (audit::collector(), host_reading::now().utc);
    let batch = |Told { recorder, record }| {
        let recorder = audit::named(site, &recorder)?;
        Some(Batch::of(collector.as_str(), recorder, vec![record], now))
    };
    let batches: Vec<Batch> = since.records.into_iter().filter_map(batch).collect();
    let appended = archive.append(&batches)?;
    let new: u64 = appended.iter().map(|appended| appended.evidence).sum();
    if new > 0 {
        inform(format_args!("commands from the state directory that are archived now: {new}"));
    }
    Ok(())
}
