//! What a reading delivers: events, and what is missing between them.

use ser_proto::{Entry, Inputs, Model};

/// What a reading hands out, in the order in which it happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// One event.
    Event {
        /// The physical number of the entry, 1 … size.
        entry_number: u16,
        /// The sequence of the event in the life of its log, from 1. `None` for entries that are
        /// read by their physical numbers, which do not tell it.
        sequence: Option<u64>,
        /// What was recorded.
        entry: Entry,
        /// The model, as the entry size shows it.
        model: Model,
    },
    /// Events that happened here and can no longer be read, or were never recorded.
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
    /// Exactly this many were overwritten by newer ones before they were read.
    Overwritten {
        /// How many.
        count: u32,
    },
    /// This many were overwritten before the first reading of this log, or a multiple of 65536
    /// more: the recorder counts modulo 65536, and no host was watching.
    OverwrittenAtLeast {
        /// How many.
        count: u32,
    },
    /// The log is not the one that was read last: it was erased, or its contents were lost with the
    /// power. It is unknown how many unread events were lost with the old log. What follows is all
    /// that the new log holds.
    LogRestarted,
    /// These inputs changed between two neighbouring entries, and no entry says when. Recording was
    /// stopped, or the recorder could not take all changes. The number of changes is unknown.
    /// Inputs that changed back meanwhile leave no trace.
    Unrecorded {
        /// The inputs.
        inputs: Inputs,
    },
}

impl Lost {
    /// What is missing between an entry and the next one in the same log, if anything. The earlier
    /// state with the inputs that changed must give the later state.
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
