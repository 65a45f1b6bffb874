//! Watches the status table and the setup table of a running board.

use crate::counters::{Counters, count, count_by};
use crate::event::{Event, Failure};
use crate::ram::SharedRam;
use crate::setup_table::Configuration;
use crate::status_table::Status;
use crate::timing;

/// The tables as last seen.
#[derive(Debug)]
pub(super) struct StatusWatch {
    due: bool,
    last: Option<Status>,
}

impl StatusWatch {
    pub(super) const fn new() -> StatusWatch {
        StatusWatch { due: false, last: None }
    }

    pub(super) fn due(&mut self) {
        self.due = true;
    }

    pub(super) fn last(&self) -> Option<Status> {
        self.last
    }

    /// Duration of a bus scan in milliseconds, limited to a believable range.
    pub(super) fn scan_ms(&self) -> u32 {
        let scan_ms = self.last.and_then(|status| status.scan_ms).unwrap_or(timing::MIN_SCAN_MS);
        scan_ms.clamp(timing::MIN_SCAN_MS, timing::MAX_SCAN_MS).into()
    }

    pub(super) fn poll<R: SharedRam>(
        &mut self,
        ram: &R,
        in_force: Configuration,
        counters: &mut Counters,
    ) -> Result<Option<Event>, Failure> {
        if !self.due {
            return Ok(None);
        }
        self.due = false;
        let status = Status::read(ram);
        if status.faults != 0 {
            return Err(Failure::Hardware { faults: status.faults });
        }
        if Configuration::read(ram) != Ok(in_force) {
            return Err(Failure::Restarted);
        }
        let before = self.last.replace(status);
        // Errors that the board counted before the first look are not ours to report.
        let errors = before.map_or(0, |before| status.bus_errors.wrapping_sub(before.bus_errors));
        count_by(&mut counters.bus_errors, errors.into());
        let was_on_bus = before.is_some_and(|before| before.on_bus());
        if was_on_bus && !status.on_bus() {
            count(&mut counters.bus_losses);
        }
        let alike = before.is_some_and(|before| {
            (before.on_bus(), before.monitor, before.excessive_errors)
                == (status.on_bus(), status.monitor, status.excessive_errors)
        });
        Ok((!alike).then_some(Event::StatusChanged(status)))
    }
}
