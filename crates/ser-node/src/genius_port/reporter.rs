//! Auto reports over Genius: which events are on their way, and when the next ones may go.

use ser_proto::ReadReply;

use crate::clock::Rtc;
use crate::recorder::Recorder;
use crate::settings::Storage;

/// Pause after the first report that did not arrive; it doubles with each further one.
const FIRST_PAUSE_MS: u32 = 20;

/// Longest pause between two attempts.
const LONGEST_PAUSE_MS: u32 = 2_560;

/// After so many failures the pause is as long as it gets.
const DOUBLINGS: u32 = (LONGEST_PAUSE_MS / FIRST_PAUSE_MS).ilog2();

/// State of the reports.
#[derive(Debug)]
pub(super) struct Reporter {
    /// Sequence number of the first event of the report on its way, and how many it has.
    first: u64,
    entries: usize,
    pause: Option<Pause>,
    /// Attempts in a row that failed.
    failures: u32,
}

#[derive(Clone, Copy, Debug)]
struct Pause {
    since_ms: u32,
    ms: u32,
}

impl Reporter {
    pub(super) const fn new() -> Reporter {
        Reporter { first: 0, entries: 0, pause: None, failures: 0 }
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

    /// The report has arrived. The next one waits for `turns_ms`, so that others have their turns.
    pub(super) fn arrived<S: Storage, R: Rtc>(
        &mut self,
        recorder: &mut Recorder<'_, S, R>,
        now_ms: u32,
        turns_ms: u32,
    ) {
        recorder.reported(self.first, self.entries);
        self.failures = 0;
        self.pause = Some(Pause { since_ms: now_ms, ms: turns_ms });
    }

    /// The report has not arrived, as far as one knows. Its events stay owed.
    pub(super) fn failed(&mut self, now_ms: u32) {
        self.pause = Some(Pause { since_ms: now_ms, ms: FIRST_PAUSE_MS << self.failures });
        self.failures = (self.failures + 1).min(DOUBLINGS);
    }

    /// The reason for the pause may be gone.
    pub(super) fn hurry(&mut self) {
        self.failures = 0;
        self.pause = None;
    }
}
