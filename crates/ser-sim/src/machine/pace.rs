//! Virtual milliseconds that keep pace with real time.

use std::time::Instant;

/// A count of milliseconds that began some time ago.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    began: Instant,
    /// The millisecond at that moment.
    ahead_ms: u64,
}

impl Pace {
    /// A count in which millisecond 0 is now.
    pub(crate) fn new() -> Pace {
        Pace::from(Instant::now(), 0)
    }

    /// A count in which millisecond `ahead_ms` was at `began`.
    pub(crate) fn from(began: Instant, ahead_ms: u64) -> Pace {
        Pace { began, ahead_ms }
    }

    /// The millisecond that a recorder should have reached.
    pub(crate) fn now_ms(&self) -> u64 {
        self.ms_at(Instant::now())
    }

    /// The millisecond at a moment.
    pub(crate) fn ms_at(&self, at: Instant) -> u64 {
        let since = at.saturating_duration_since(self.began).as_millis();
        self.ahead_ms.saturating_add(u64::try_from(since).unwrap_or(u64::MAX))
    }
}
