//! Whether events come faster than they can be read, and how much is given up then.
//!
//! A look at the anchor now and then would find it overwritten each time. So the reader does not
//! look for it, takes whatever the ring holds, and lets the size of the ring prove it.

use ser_proto::MAX_ENTRIES;

use super::head::Head;

/// How many times the events of one request are given up, to get ahead of the recorder. As many
/// come while the reader reads and while it looks at the ring once more, and then it must not be
/// behind.
const GIVE_UP: u64 = 4;

/// How fast events come.
#[derive(Debug, Default)]
pub(super) struct Overrun {
    /// Events that came between two of the latest replies.
    pub(super) pace: u64,
    /// How far ahead of the oldest entry reading goes on after a loss. Above 0 once the recorder
    /// was faster.
    pub(super) margin: u64,
    /// Events before this index are not waited for, whether they are still there or not.
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

    /// The log began anew, and nothing was lost of it.
    pub(super) fn restart(&mut self) {
        self.margin = 0;
        self.given_up = 0;
    }

    /// So many events came during one request, and some were lost: reading goes on further ahead.
    pub(super) fn widen_margin(&mut self, events: u64) {
        self.margin = self.margin.max(GIVE_UP * events);
    }

    /// The first event from `index` on that is worth asking for. A request is read after the reply
    /// that has just come and the one on the line, and its entries must not be overwritten by then.
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
