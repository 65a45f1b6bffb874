//! Events that somebody is still to be told of.
//!
//! Only a position in the log is kept, so nothing is lost until the ring overwrites it, and then it
//! is counted.

use crate::event_log::EventLog;

/// The events from a position in the log on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Owed {
    /// Sequence number of the next event to tell of.
    next: u64,
}

impl Owed {
    /// Everything since power-up.
    pub(crate) const ALL: Owed = Owed { next: 0 };

    /// None of the events that there are; the next one is the first.
    pub(crate) fn none(log: &EventLog<'_>) -> Owed {
        Owed { next: log.next_sequence() }
    }

    /// Passes over what the ring has overwritten; says how many events these were.
    pub(crate) fn skip_overwritten(&mut self, log: &EventLog<'_>) -> u64 {
        let overwritten = log.oldest_sequence().saturating_sub(self.next);
        self.next += overwritten;
        overwritten
    }

    /// Sequence number of the first event that is owed, as soon as there is one.
    pub(crate) fn first(self) -> u64 {
        self.next
    }

    /// So many events from `first` on have been told of. Means nothing when others are owed by now.
    pub(crate) fn told(&mut self, first: u64, events: usize) {
        if self.next == first {
            self.next += events as u64;
        }
    }
}
