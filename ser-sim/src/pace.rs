//! Virtual milliseconds that keep pace with real time.

use std::time::Instant;

/// A count of milliseconds that began some time ago.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    began: Instant,
}

impl Pace {
    /// Millisecond 0 is now.
    pub(crate) fn new() -> Pace {
        Pace { began: Instant::now() }
    }

    /// The millisecond that a node should have reached.
    pub(crate) fn now_ms(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}
