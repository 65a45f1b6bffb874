//! What a reading came to.

use super::log_position::LogPosition;

/// What a reading came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Events that were delivered.
    pub delivered: u32,
    /// Events that are known to be lost.
    pub lost: u32,
    /// Places at which inputs had changed and nothing was recorded.
    pub unrecorded: u32,
    /// Whether the log began anew, so that an unknown number is lost besides.
    pub restarted: bool,
    /// Where the log stood in the latest reply.
    pub position: LogPosition,
}
