//! What a host remembers of a log between two readings, and what a reading delivers.

use ser_proto::{Entry, Model};

/// How far a host has read. Keep it, and the next reading starts right after.
///
/// `total` alone would do if logs were never erased; the anchor tells a log that went on from one that began anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cursor {
    /// The recorder's total after the last event that was delivered, modulo 65536.
    pub total: u16,
    /// The last event that was delivered; `None` if the log was empty.
    pub anchor: Option<Entry>,
}

/// What a reading hands out, in the order in which it happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// One event.
    Event {
        /// The physical number of the entry, 1 … size.
        entry_number: u16,
        /// What was recorded.
        entry: Entry,
        /// The model, as the entry size shows it.
        model: Model,
    },
    /// Events that happened here and cannot be read any more.
    Lost(Lost),
}

/// Why events are missing from what was delivered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// Exactly so many were overwritten by newer ones before they were read.
    Overwritten {
        /// How many.
        count: u32,
    },
    /// So many were overwritten before the first reading of this log, or a multiple of 65536 more: the recorder
    /// counts modulo 65536 and nobody watched.
    OverwrittenAtLeast {
        /// How many.
        count: u32,
    },
    /// The log is not the one that was read last: it was erased or lost its contents (power). How many events went
    /// unread with the old one is not known; what follows is all that the new one holds.
    LogRestarted,
}

impl Lost {
    /// How many are known to be lost.
    #[must_use]
    pub const fn known_count(self) -> u32 {
        match self {
            Lost::Overwritten { count } | Lost::OverwrittenAtLeast { count } => count,
            Lost::LogRestarted => 0,
        }
    }
}
