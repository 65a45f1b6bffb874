//! Reading entries by their physical numbers, as they stand in the ring.

use ser_proto::{MAX_ENTRIES, MAX_SIZE, ReadReply};

use crate::{Delivery, LogPosition, ReadRequest};

/// Reads a range of entries. Events that are recorded meanwhile may overwrite entries of the range between two
/// replies; [`LogReader`](crate::LogReader) notices that, this does not.
#[derive(Debug)]
pub struct RangeReader {
    next: u16,
    /// Behind the last entry.
    end: u16,
    position: Option<LogPosition>,
    delivered: u16,
}

impl RangeReader {
    /// Reads `count` entries from number `start` (from 1) of a ring of `size` entries. What is outside of the ring
    /// is left out.
    #[must_use]
    pub fn new(start: u16, count: u16, size: u16) -> RangeReader {
        let size = size.clamp(1, MAX_SIZE);
        let end = start.saturating_add(count).min(size + 1);
        RangeReader { next: if start == 0 { end } else { start }, end, position: None, delivered: 0 }
    }

    /// The entries to ask for next; `None` when all have come, or those that exist.
    #[must_use]
    pub fn request(&self) -> Option<ReadRequest> {
        let count = usize::from(self.end.saturating_sub(self.next)).min(MAX_ENTRIES);
        let count = u8::try_from(count).ok().filter(|&count| count > 0)?;
        Some(ReadRequest { start: self.next, count })
    }

    /// Takes the reply to [`request`](Self::request) and delivers its entries.
    pub fn take(&mut self, reply: &ReadReply, on: &mut dyn FnMut(Delivery)) {
        let Some(request) = self.request().filter(|request| request.start == reply.start) else { return };
        self.position = Some(LogPosition::from(reply));
        let Some(model) = reply.model else {
            // The log ends here.
            self.end = self.next;
            return;
        };
        for &entry in reply.entries.iter().take(request.count.into()) {
            on(Delivery::Event { entry_number: self.next, entry, model });
            self.next += 1;
            self.delivered += 1;
        }
    }

    /// Where the log stood in the latest reply.
    #[must_use]
    pub const fn position(&self) -> Option<LogPosition> {
        self.position
    }

    /// How many entries were delivered.
    #[must_use]
    pub const fn delivered(&self) -> u16 {
        self.delivered
    }
}
