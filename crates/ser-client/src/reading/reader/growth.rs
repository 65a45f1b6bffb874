//! Whether the ring was made larger.
//!
//! A log that is not full and holds fewer entries than it has had events was in a smaller ring
//! before, or does not have the size that was given. If an entry stands behind the head, it is from
//! the round before: the ring goes round earlier than it should.

use super::head::Head;
use crate::reading::disturbed::Disturbed;
use crate::reading::read_request::ReadRequest;

/// Whether it is known that the ring was made larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Growth {
    Unasked,
    /// The slots behind the head are asked for next, or their reply is awaited.
    Asking,
    Certain,
}

impl Growth {
    /// Whether a log that is not full can be believed. If that is not known, it is asked next.
    pub(super) fn explains(&mut self, head: Head) -> bool {
        if head.holds_all() {
            return true;
        }
        if *self == Growth::Unasked {
            *self = Growth::Asking;
        }
        *self == Growth::Certain
    }

    /// Takes the number of `entries` in the slots behind the head, and says whether the ring was
    /// made larger. If events have filled all the slots meanwhile, that is not known yet.
    pub(super) fn answered(
        &mut self,
        request: ReadRequest,
        entries: usize,
        head: Head,
    ) -> Result<bool, Disturbed> {
        // Events may have come into these slots since the request.
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
