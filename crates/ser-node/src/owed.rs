//! Events that a receiver has not been told of yet.
//!
//! Only a position in the log is kept. No event is lost until the ring overwrites it, and that is
//! counted.

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

    /// None of the existing events; the next one is the first.
    pub(crate) fn none(log: &EventLog<'_>) -> Owed {
        Owed { next: log.next_sequence() }
    }

    /// Skips what the ring has overwritten; returns how many events that were.
    pub(crate) fn skip_overwritten(&mut self, log: &EventLog<'_>) -> u64 {
        let overwritten = log.oldest_sequence().saturating_sub(self.next);
        self.next += overwritten;
        overwritten
    }

    /// Sequence number of the first event owed, or of the next event if none is owed.
    pub(crate) fn first(self) -> u64 {
        self.next
    }

    /// Marks that many events from `first` on as told. Has no effect when other events are owed by
    /// now.
    pub(crate) fn told(&mut self, first: u64, events: usize) {
        if self.next == first {
            self.next += events as u64;
        }
    }
}
