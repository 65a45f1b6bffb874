//! Reading while events come faster than they can be read: whatever the ring holds, proven by its size.

use ser_proto::MAX_ENTRIES;

use super::super::delivery::Delivery;
use super::super::read_request::ReadRequest;
use super::{Asked, Batch, Footing, Growth, HASTE, Head, LogReader, Pending, Purpose};

impl LogReader {
    /// Whether events come faster than they can be read with a look at the anchor now and then. Whatever the ring holds
    /// is taken then, and a look whether it still has its size proves it.
    pub(super) fn is_in_haste(&self) -> bool {
        self.margin > 0 && self.pace >= MAX_ENTRIES as u64
    }

    /// In haste nobody looks for the anchor. What was read ahead of it is held until the ring has shown its size.
    pub(super) fn stop_looking_for_anchor(&mut self) {
        let is_anchored = matches!(self.footing, Footing::Anchored(_));
        if is_anchored && self.is_in_haste() && self.growth != Growth::Asking {
            self.footing = if self.ahead.is_empty() { Footing::Firm } else { Footing::Held };
        }
    }

    /// Keeps all entries of a reply that are new, whichever events have come to these slots by now.
    pub(super) fn take_in_haste(&mut self, request: ReadRequest, batch: Batch<'_>) {
        let Some(head) = self.head else { return };
        for (slot, &entry) in (u64::from(request.start) - 1..).zip(batch.entries) {
            let age = (head.slot + self.size - slot - 1) % self.size;
            let offset = (head.total - 1 - age).checked_sub(self.next);
            if let Some(offset) = offset.and_then(|offset| usize::try_from(offset).ok()) {
                self.ahead.keep(offset, entry, batch.model);
            }
        }
        self.footing = Footing::Held;
    }

    /// Delivers everything that is known, and counts what is missing in between, as far as that is overwritten or given
    /// up.
    pub(super) fn deliver_past_gaps(&mut self, on: &mut dyn FnMut(Delivery)) {
        let Some(head) = self.head else { return };
        let end = self.given_up.max(head.total.saturating_sub(self.size));
        self.deliver(on);
        // A loss is counted when the event after it is there.
        while let Some(known) = self.ahead.first_known().map(|offset| self.next + offset)
            && known <= end
        {
            self.skip_to(known);
            self.deliver(on);
        }
    }

    /// Asks for events and for a look at the size of the ring in turn, each while the other one is on the line.
    pub(super) fn plan_in_haste(&mut self, head: Head) -> Option<Asked> {
        let probe = Asked { request: self.probe(), purpose: Purpose::Probe };
        let all = self.asked.len();
        let is_probing = self.asked.iter().any(|asked| asked.purpose == Purpose::Probe);
        let is_reading = self.asked.iter().any(|asked| asked.purpose != Purpose::Probe);
        if !is_probing && (is_reading || self.footing == Footing::Held) {
            return Some(probe);
        }
        let mut first = self.unasked_from(self.next.max(self.given_up), all);
        // A loss is told with the event after it.
        if is_reading || (first >= self.target && self.pending == Pending::default()) {
            return None;
        }
        // It is read after the reply that has just come and the one that is on the line, and must not be overwritten by
        // then.
        let oldest = head.total - self.size;
        if first < oldest + 2 * self.pace {
            let furthest = (self.size / 2).max(self.size.saturating_sub(2 * MAX_ENTRIES as u64));
            self.given_up = oldest + (HASTE * self.pace).min(furthest);
            first = first.max(self.given_up);
        }
        let request = self.events(head, first.min(head.total), MAX_ENTRIES as u64);
        Some(Asked { request, purpose: Purpose::Haste })
    }
}
