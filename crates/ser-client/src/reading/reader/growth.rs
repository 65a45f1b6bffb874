//! Whether the ring was made larger.
//!
//! A log that is not full and holds fewer entries than it has had events either was in a smaller
//! ring before, or its size is not the given one. Say that 300 events have been recorded, the next
//! slot is 120, and the size is believed to be 256. If the ring had 120 slots before and was made
//! larger, its entries are in the first 120 slots and the slots after them are empty. If the slots
//! after them hold entries, these are of the round before: the ring has 180 slots, and the given
//! size is wrong.

use super::head::Head;
use crate::reading::disturbed::Disturbed;
use crate::reading::read_request::ReadRequest;

/// Whether it is known that the ring was made larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Growth {
    Unasked,
    /// The slots after the head are asked for next, or their reply is awaited.
    Asking,
    Certain,
}

impl Growth {
    /// Whether a log that is not full is explained. If that is unknown, it is asked next.
    pub(super) fn explains(&mut self, head: Head) -> bool {
        if head.holds_all() {
            return true;
        }
        if *self == Growth::Unasked {
            *self = Growth::Asking;
        }
        *self == Growth::Certain
    }

    /// Takes the number of `entries` in the slots after the head, and returns whether the ring was
    /// made larger. That stays unknown if events have filled all the slots meanwhile.
    pub(super) fn answered(
        &mut self,
        request: ReadRequest,
        entries: usize,
        head: Head,
    ) -> Result<bool, Disturbed> {
        // Events may have filled some of these slots since the request.
        let end = u64::from(request.start) - 1 + entries as u64;
        if end > head.slot {
            return Err(Disturbed::WrongSize);
        }
        if entries == usize::from(request.count) {
            return Ok(false);
        }
        *self = Growth::Certain;
        Ok(true)
    }
}
