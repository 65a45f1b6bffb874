//! Auto reports over Genius: which events are on their way, and when the next ones may go.

/// Pause after the first report that did not arrive. It doubles with each further failure.
const FIRST_PAUSE_MS: u32 = 20;

/// Longest pause between two attempts.
const LONGEST_PAUSE_MS: u32 = 2_560;

/// The pause stops growing after that many failures.
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

    /// Whether the next report may go now.
    pub(super) fn may_send(&self, now_ms: u32) -> bool {
        self.pause.is_none_or(|pause| now_ms.wrapping_sub(pause.since_ms) >= pause.ms)
    }

    /// Notes that a report of that many events from `first` on has been sent.
    pub(super) fn sent(&mut self, first: u64, entries: usize) {
        (self.first, self.entries) = (first, entries);
    }

    /// Notes that the report has arrived; returns its first event and how many it has. The next one
    /// waits for `turns_ms`, to leave the other devices their turns.
    pub(super) fn arrived(&mut self, now_ms: u32, turns_ms: u32) -> (u64, usize) {
        self.failures = 0;
        self.pause = Some(Pause { since_ms: now_ms, ms: turns_ms });
        (self.first, self.entries)
    }

    /// Notes that the report has not arrived, as far as is known. Its events stay owed.
    pub(super) fn failed(&mut self, now_ms: u32) {
        self.pause = Some(Pause { since_ms: now_ms, ms: FIRST_PAUSE_MS << self.failures });
        self.failures = (self.failures + 1).min(DOUBLINGS);
    }

    /// Ends the pause, because its reason may be gone.
    pub(super) fn hurry(&mut self) {
        self.failures = 0;
        self.pause = None;
    }
}
