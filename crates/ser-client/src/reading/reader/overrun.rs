//! Whether events come faster than they can be read, and how many are given up then.
//!
//! The anchor would be overwritten before each look at it. So the reader does not look for it. It
//! takes whatever the ring holds, and the size of the ring is the proof.

use ser_proto::MAX_ENTRIES;

use super::head::Head;

/// How many requests' worth of events are given up, to get ahead of the recorder. As many events
/// come while the reader reads and probes the ring once more, and it must not be behind after that.
const GIVE_UP: u64 = 4;

/// How fast events come.
#[derive(Debug, Default)]
pub(super) struct Overrun {
    /// Events that came between two of the latest replies.
    pub(super) pace: u64,
    /// How far ahead of the oldest entry reading continues after a loss. It is above 0 once the
    /// recorder was faster.
    pub(super) margin: u64,
    /// Events before this index are not waited for, even if they are still in the ring.
    pub(super) given_up: u64,
}

impl Overrun {
    /// Whether events come faster than they can be read with a look at the anchor now and then.
    pub(super) fn is_on(&self) -> bool {
        self.margin > 0 && self.is_fast()
    }

    /// Whether more events come between two replies than one reply holds.
    pub(super) fn is_fast(&self) -> bool {
        self.pace >= MAX_ENTRIES as u64
    }

    /// Notes that the log began anew without a loss.
    pub(super) fn restart(&mut self) {
        self.margin = 0;
        self.given_up = 0;
    }

    /// Notes that this many events came during one request and some were lost. Reading continues
    /// further ahead.
    pub(super) fn widen_margin(&mut self, events: u64) {
        self.margin = self.margin.max(GIVE_UP * events);
    }

    /// The first event from `index` on that is worth asking for. The request is answered after the
    /// reply that has just come and the one on the line, and its entries must not be overwritten by
    /// then.
    pub(super) fn worth_asking_from(&mut self, index: u64, head: Head) -> u64 {
        let oldest = head.oldest();
        if index >= oldest + 2 * self.pace {
            return index;
        }
        let furthest = (head.size / 2).max(head.size.saturating_sub(2 * MAX_ENTRIES as u64));
        self.given_up = oldest + (GIVE_UP * self.pace).min(furthest);
        index.max(self.given_up)
    }
}
