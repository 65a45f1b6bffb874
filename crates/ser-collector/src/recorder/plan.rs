//! How a recorder is going to be read: by its reports, or by asking it.

use ser_client::{LogFollower, LogWatcher, ReportSwitch, Unit};
use ser_proto::{AutoReport, Configuration, Configure};
use tracing::info;

use super::Task;
use crate::check::settings;
use crate::trouble::Trouble;

/// How a recorder is going to be read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// How many entries its log holds.
    pub(super) size: u16,
    /// Auto reports, if they come to this computer or may be made to.
    reports: Option<(ReportSwitch, Configuration)>,
}

impl Task {
    /// Asks for what the plan depends on. An original recorder does not say how large its log is;
    /// the site file does, or it is known from before.
    ///
    /// The settings that were `found` first are what is put back in the end. A later visit may find
    /// what an earlier one has left.
    pub(super) fn plan(
        &self,
        unit: &mut Unit,
        known: Option<u16>,
        found_first: &mut Option<Configuration>,
    ) -> Result<Plan, Trouble> {
        let said = self.recorder.log_size;
        if let (true, Some(size)) = (self.recorder.is_original, said) {
            return Ok(Plan { size, reports: None });
        }
        let Some(found) = settings(unit)? else {
            let size = said.or(known).ok_or(Trouble::SizeUnknown)?;
            return Ok(Plan { size, reports: None });
        };
        let reports = self.reports(unit, found);
        let first = *found_first.get_or_insert(found);
        Ok(Plan { size: found.size, reports: reports.map(|switch| (switch, first)) })
    }

    /// How the recorder is made to report here, if it may be.
    fn reports(&self, unit: &Unit, found: Configuration) -> Option<ReportSwitch> {
        if self.shared.options.once {
            return None;
        }
        let here = match unit.bus_address() {
            Some(address) => (AutoReport::Genius, address),
            None => (AutoReport::Rs232, found.report_address),
        };
        let is_on = match found.auto_report {
            AutoReport::Off => false,
            AutoReport::Genius => (found.auto_report, found.report_address) == here,
            AutoReport::Rs232 => found.auto_report == here.0,
        };
        let is_free = found.auto_report == AutoReport::Off && self.shared.options.may_configure;
        let keep = Configure { size: None, baud: None, ..found.into() };
        let on = Configure { auto_report: here.0, report_address: here.1, ..keep };
        let off = Configure { auto_report: AutoReport::Off, ..keep };
        (is_on || is_free).then_some(ReportSwitch { on, off, is_on })
    }
}

impl Plan {
    /// Begins to read in this way.
    pub(super) fn watcher(&self, follower: LogFollower, task: &Task) -> LogWatcher {
        let times = &task.shared.options.times;
        match self.reports {
            Some((switch, _)) => LogWatcher::reporting(follower, times.check, switch),
            None => LogWatcher::polling(follower, times.poll, true),
        }
    }

    /// Puts the recorder's setting back, if it was changed.
    pub(super) fn put_back(&self, has_switched: bool, unit: &mut Unit, recorder: &str) {
        let Some((_, found)) = self.reports.filter(|_| has_switched) else { return };
        let keep = Configure { size: None, baud: None, ..found.into() };
        if let Err(error) = unit.configure(keep) {
            info!("{recorder}: its auto report could not be put back: {error}");
        }
    }
}
