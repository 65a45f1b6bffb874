//! What must be in a log: events, and erases between them.

use chrono::NaiveDateTime;
use ser_proto::{Entry, TimeStamp};

/// An event that must be recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Its stamp, in milliseconds since 1970.
    pub stamp_ms: i64,
    /// The inputs that changed.
    pub changed: u32,
    /// The inputs that are on.
    pub state: u32,
    /// When it happened.
    pub at_ms: u64,
    /// Inputs that changed since the event before, and of which no event tells; those that changed
    /// back are not in it.
    pub unrecorded: u32,
}

impl Recorded {
    /// Whether this is what an entry says.
    #[must_use]
    pub fn is(&self, entry: &Entry) -> bool {
        (self.changed, self.state) == (entry.changed.0, entry.state.0)
            && stamp_ms(entry.time) == Some(self.stamp_ms)
    }
}

/// Milliseconds since 1970; nothing if there is no such time.
pub(super) fn stamp_ms(time: TimeStamp) -> Option<i64> {
    NaiveDateTime::try_from(time).ok().map(|time| time.and_utc().timestamp_millis())
}

/// An erase, between two events: `from` is the index of the first event that may be after it, `to`
/// of the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Erase {
    /// The earliest it can have been.
    pub from: usize,
    /// The latest it can have been; grows until its reply has been seen.
    pub to: usize,
    /// Whether it has been, and not only may have been.
    pub certain: bool,
}

impl Erase {
    /// Power-up is as good as an erase.
    pub const POWER_UP: Erase = Erase { from: 0, to: 0, certain: true };
}
