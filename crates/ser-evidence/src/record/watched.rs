//! Spans of time for which a reader vouches.

use super::{HostReading, Life};

/// From `from` to `to` nothing was missed: every entry that was in the log by then, up to
/// `through`, was delivered or is told as a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watched {
    /// The life of the log.
    pub life: Life,
    /// When the reading, or the watching, began.
    pub from: HostReading,
    /// When the last reading that found nothing more was asked for.
    pub to: HostReading,
    /// The sequence of the newest entry then; 0 if the log was empty.
    pub through: u64,
}
