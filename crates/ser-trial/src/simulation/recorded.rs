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
    /// Inputs that changed since the event before without an event. Inputs that changed back are
    /// not included.
    pub unrecorded: u32,
}

impl Recorded {
    /// Whether an entry says the same.
    #[must_use]
    pub fn is(&self, entry: &Entry) -> bool {
        (self.changed, self.state) == (entry.changed.0, entry.state.0)
            && stamp_ms(entry.time) == Some(self.stamp_ms)
    }
}

/// Milliseconds since 1970; `None` if there is no such time.
pub(super) fn stamp_ms(time: TimeStamp) -> Option<i64> {
    NaiveDateTime::try_from(time).ok().map(|time| time.and_utc().timestamp_millis())
}

/// An erase between two events. `from` is the index of the first event that may be after it, `to`
/// that of the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Erase {
    /// The earliest index at which it can have been.
    pub from: usize,
    /// The latest index at which it can have been. It grows until the erase's reply has been seen.
    pub to: usize,
    /// Whether it has certainly happened.
    pub certain: bool,
}

impl Erase {
    /// Power-up, which has the same effect as an erase.
    pub const POWER_UP: Erase = Erase { from: 0, to: 0, certain: true };
}
