//! The lockout bytes (chapter 9): keeping the board out of the tables for a moment.

use crate::map;
use crate::ram::SharedRam;

/// The state of the two bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lockout {
    /// Neither byte is set.
    Free,
    /// Requested, but not yet granted. The request must not be withdrawn.
    Requested,
    /// Both bytes are set: the board keeps out.
    Locked,
    /// Given back, but the board has not noticed yet.
    Releasing,
}

impl Lockout {
    pub(crate) fn read<R: SharedRam>(ram: &R) -> Lockout {
        let set = |offset| ram.read(offset) & 1 != 0;
        match (set(map::LOCKOUT_REQUEST), set(map::LOCKOUT_STATE)) {
            (false, false) => Lockout::Free,
            (true, false) => Lockout::Requested,
            (true, true) => Lockout::Locked,
            (false, true) => Lockout::Releasing,
        }
    }

    /// Requests lockout; allowed only from [`Lockout::Free`].
    pub(crate) fn request<R: SharedRam>(ram: &mut R) {
        ram.write(map::LOCKOUT_REQUEST, 1);
    }

    /// Gives lockout back; allowed only from [`Lockout::Locked`].
    pub(crate) fn release<R: SharedRam>(ram: &mut R) {
        ram.write(map::LOCKOUT_REQUEST, 0);
    }
}
