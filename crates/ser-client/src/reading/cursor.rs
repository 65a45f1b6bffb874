//! What a host remembers of a log between two readings.
//!
//! A log lives from a power-up or erase to the next one. Within a life every event has a
//! *sequence*: the recorder's total after it, 1 for the first event. The recorder shows totals
//! modulo 65536. A host that continues from a [`Cursor`] unwraps them.

use ser_proto::Entry;

/// How far a host has read. The next reading starts right after it.
///
/// `sequence` alone would be enough if logs were never erased. The anchor tells a log that
/// continued from one that began anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cursor {
    /// The sequence of the last event that was delivered; 0 if the log was empty.
    pub sequence: u64,
    /// Whether `sequence` counts from the beginning of the log. Otherwise the total may already
    /// have wrapped when the host first saw the log, and a multiple of 65536 may be missing.
    pub is_exact: bool,
    /// The last event that was delivered; `None` if the log was empty.
    pub anchor: Option<Entry>,
}

impl Cursor {
    /// The recorder's total after the last event that was delivered, modulo 65536.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the low 16 bits are what is wanted")]
    pub const fn total(&self) -> u16 {
        self.sequence as u16
    }
}
