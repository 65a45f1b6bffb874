//! Auto reports over Genius: which events are on their way, and when to try again.

use ser_proto::ReadReply;

use crate::clock::Rtc;
use crate::recorder::Recorder;
use crate::settings::Storage;

/// Pause after the first report that did not arrive; it doubles with each further one.
const FIRST_PAUSE_MS: u32 = 20;

/// Longest pause between two attempts.
const LONGEST_PAUSE_MS: u32 = 2_560;

/// State of the reports.
#[derive(Debug)]
pub(super) struct Reporter {
    /// Sequence number of the first event of the report on its way, and how many it has.
    first: u64,
    entries: usize,
    pause: Option<Pause>,
}

#[derive(Clone, Copy, Debug)]
struct Pause {
    since_ms: u32,
    ms: u32,
}

impl Reporter {
    pub(super) const fn new() -> Reporter {
        Reporter { first: 0, entries: 0, pause: None }
    }

    /// The next report, unless it is to be waited with, or there is none.
    pub(super) fn next<S: Storage, R: Rtc>(
        &mut self,
        recorder: &mut Recorder<'_, S, R>,
        max_entries: usize,
        now_ms: u32,
    ) -> Option<ReadReply> {
        if self.pause.is_some_and(|pause| now_ms.wrapping_sub(pause.since_ms) < pause.ms) {
            return None;
        }
        let (first, report) = recorder.report(max_entries)?;
        (self.first, self.entries) = (first, report.entries.len());
        Some(report)
    }

    /// The report has arrived.
    pub(super) fn arrived<S: Storage, R: Rtc>(&mut self, recorder: &mut Recorder<'_, S, R>) {
        recorder.reported(self.first, self.entries);
        self.pause = None;
    }

    /// The report has not arrived, as far as one knows. Its events stay owed.
    pub(super) fn failed(&mut self, now_ms: u32) {
        let ms = self.pause.map_or(FIRST_PAUSE_MS, |pause| (pause.ms * 2).min(LONGEST_PAUSE_MS));
        self.pause = Some(Pause { since_ms: now_ms, ms });
    }

    /// The reason for the pause may be gone.
    pub(super) fn hurry(&mut self) {
        self.pause = None;
    }
}
