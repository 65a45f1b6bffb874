//! What a host remembers of a log between two readings.
//!
//! A log lives from power-up or erase to the next. Within a life every event has a *sequence*: the
//! recorder's total after it, 1 for the first. The recorder shows totals modulo 65536; a host that
//! goes on from a [`Cursor`] unwraps them.

use ser_proto::Entry;

/// How far a host has read. Keep it, and the next reading starts right after.
///
/// `sequence` alone would do if logs were never erased; the anchor tells a log that went on from
/// one that began anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cursor {
    /// The sequence of the last event that was delivered; 0 if the log was empty.
    pub sequence: u64,
    /// Whether `sequence` counts from the beginning of the log. Otherwise the host has first seen
    /// the log when it had gone round, and a multiple of 65536 may be missing.
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
