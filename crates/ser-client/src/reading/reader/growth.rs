//! Whether the ring was made larger.
//!
//! A log that is not full and holds fewer entries than it has had events was in a smaller ring
//! before, or its size is not the given one. An entry after the head would be from the round
//! before: the ring then turns earlier than it should.

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
