//! What a host remembers of a log between two readings, and what a reading delivers.
//!
//! A log lives from power-up or erase to the next. Within a life every event has a *sequence*: the
//! recorder's total after it, 1 for the first. The recorder shows totals modulo 65536; a host that
//! goes on from a [`Cursor`] unwraps them.

use ser_proto::{Entry, Inputs, Model};

/// How far a host has read. Keep it, and the next reading starts right after.
///
/// `sequence` alone would do if logs were never erased; the anchor tells a log that went on from one
/// that began anew.
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

/// What a reading hands out, in the order in which it happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// One event.
    Event {
        /// The physical number of the entry, 1 … size.
        entry_number: u16,
        /// The sequence of the event in the life of its log, from 1. `None` where entries are read by
        /// their physical numbers, which do not tell.
        sequence: Option<u64>,
        /// What was recorded.
        entry: Entry,
        /// The model, as the entry size shows it.
        model: Model,
    },
    /// Events that happened here and cannot be read any more, or never were recorded.
    Lost {
        /// The sequence of the last event before the loss; 0 if the loss is at the beginning of the
        /// log. `None` where entries are read by their physical numbers.
        after: Option<u64>,
        /// What is missing.
        lost: Lost,
    },
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
    /// These inputs changed between two neighbouring entries, and no entry says when: recording was
    /// stopped, or the recorder could not take all changes. How many changes there were is not known;
    /// inputs that changed back meanwhile leave no trace.
    Unrecorded {
        /// The inputs.
        inputs: Inputs,
    },
}

impl Lost {
    /// What is missing between an entry and the one right after it in the same log, if anything: the
    /// state before, with what changed, has to be the state after.
    #[must_use]
    pub fn between(entry: &Entry, next: &Entry) -> Option<Lost> {
        let inputs = Inputs(entry.state.0 ^ next.changed.0 ^ next.state.0);
        (!inputs.is_empty()).then_some(Lost::Unrecorded { inputs })
    }

    /// How many events are known to be lost.
    #[must_use]
    pub const fn known_count(self) -> u32 {
        match self {
            Lost::Overwritten { count } | Lost::OverwrittenAtLeast { count } => count,
            Lost::LogRestarted | Lost::Unrecorded { .. } => 0,
        }
    }
}
