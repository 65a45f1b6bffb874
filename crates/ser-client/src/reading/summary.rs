//! The result of a reading.

use super::log_position::LogPosition;

/// The result of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Events that were delivered.
    pub delivered: u32,
    /// Events that are known to be lost.
    pub lost: u32,
    /// How many times inputs had changed without being recorded.
    pub unrecorded: u32,
    /// Whether the log began anew, so that an unknown number of events is also lost.
    pub restarted: bool,
    /// Where the log stood in the latest reply.
    pub position: LogPosition,
}
