//! Entries as they were read.

use ser_proto::{Entry, Inputs};

use super::Life;

/// One entry of a recorder's log. Recorder, life and sequence are what an entry *is*; its time and
/// its number in the ring are not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryRecord {
    /// The life of its log; [`Life::UNKNOWN`] from a reading that remembers nothing.
    pub life: Life,
    /// The recorder's total after it in this life, from 1; `None` if it was read by its number.
    pub sequence: Option<u64>,
    /// Its number in the ring, from 1.
    pub number: u16,
    /// Changed inputs, state and stamp exactly as they were read.
    pub entry: Entry,
    /// The inputs whose state in `entry` is known; the others are off there, and say nothing.
    /// Recorders tell [all](Self::ALL_KNOWN). A file that shows only changes does not, so the same
    /// entry read from there is no contradiction if it agrees in what is known.
    pub known: Inputs,
}

impl EntryRecord {
    /// The state of every input is known.
    pub const ALL_KNOWN: Inputs = Inputs(u32::MAX);
}
