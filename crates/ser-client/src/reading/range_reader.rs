//! Reading entries by their physical numbers, in the order of the ring.

use ser_proto::{Entry, MAX_ENTRIES, MAX_SIZE, ReadReply};

use super::delivery::{Delivery, Lost};
use super::log_position::LogPosition;
use super::read_request::ReadRequest;

/// Reads a range of entries. Events that are recorded meanwhile may overwrite entries of the range
/// between two replies. [`LogReader`](crate::LogReader) follows such events; this reader only
/// reports them: [`is_mixed`](Self::is_mixed).
#[derive(Debug)]
pub struct RangeReader {
    start: u16,
    next: u16,
    /// The number after the last entry.
    end: u16,
    /// Where the log stood in the first reply.
    first: Option<LogPosition>,
    position: Option<LogPosition>,
    /// The entry before `next`, while no event has come since it was read.
    before: Option<Entry>,
    delivered: u16,
}

impl RangeReader {
    /// Reads `count` entries from number `start` (from 1) of a ring of `size` entries. Numbers
    /// outside the ring are left out.
    #[must_use]
    pub fn new(start: u16, count: u16, size: u16) -> RangeReader {
        let size = size.clamp(1, MAX_SIZE);
        let end = start.saturating_add(count).min(size + 1);
        let next = if start == 0 { end } else { start };
        RangeReader { start, next, end, first: None, position: None, before: None, delivered: 0 }
    }

    /// The entries to ask for next; `None` when all existing entries have come.
    #[must_use]
    pub fn request(&self) -> Option<ReadRequest> {
        let count = usize::from(self.end.saturating_sub(self.next)).min(MAX_ENTRIES);
        let count = u8::try_from(count).ok().filter(|&count| count > 0)?;
        Some(ReadRequest { start: self.next, count })
    }

    /// Takes the reply to [`request`](Self::request) and delivers its entries.
    pub fn take(&mut self, reply: &ReadReply, on: &mut dyn FnMut(Delivery)) {
        let Some(request) = self.request().filter(|request| request.start == reply.start) else {
            return;
        };
        let position = LogPosition::from(reply);
        if self.position.is_some_and(|earlier| !self.keeps_before(earlier, position)) {
            self.before = None;
        }
        self.position = Some(position);
        self.first = self.first.or(self.position);
        let Some(model) = reply.model else {
            // The log ends here.
            self.end = self.next;
            return;
        };
        for &entry in reply.entries.iter().take(request.count.into()) {
            // In a full ring the oldest entry directly follows the newest.
            let before = self.before.filter(|_| !self.is_seam(self.next));
            if let Some(lost) = before.and_then(|before| Lost::between(&before, &entry)) {
                on(Delivery::Lost { after: None, lost });
            }
            on(Delivery::Event { entry_number: self.next, sequence: None, entry, model });
            self.before = Some(entry);
            self.next += 1;
            self.delivered += 1;
        }
    }

    /// Whether an entry is the first after the newest: the oldest of a full ring. It is unrelated
    /// to the entry before it by number.
    #[must_use]
    pub fn is_seam(&self, entry_number: u16) -> bool {
        self.position
            .is_some_and(|position| entry_number.checked_sub(1) == Some(position.next_slot))
    }

    /// Whether the entry before `next` is still the same, although the log has moved on between two
    /// replies.
    fn keeps_before(&self, earlier: LogPosition, now: LogPosition) -> bool {
        let Some(slot) = self.next.checked_sub(2) else { return true };
        earlier == now
            || went_straight(earlier, now) && !(earlier.next_slot..now.next_slot).contains(&slot)
    }

    /// Where the log stood in the latest reply.
    #[must_use]
    pub const fn position(&self) -> Option<LogPosition> {
        self.position
    }

    /// Whether events that were recorded during the reading may have overwritten entries of the
    /// range.
    #[must_use]
    pub fn is_mixed(&self) -> bool {
        let (Some(first), Some(last)) = (self.first, self.position) else { return false };
        if first == last {
            return false;
        }
        // Slot `n - 1` holds entry `n`.
        let slots = self.start.saturating_sub(1)..self.next.saturating_sub(1);
        // If the ring turned or the log was erased, every entry may have been written.
        !went_straight(first, last) || (first.next_slot < slots.end && slots.start < last.next_slot)
    }

    /// How many entries were delivered.
    #[must_use]
    pub const fn delivered(&self) -> u16 {
        self.delivered
    }
}

/// Whether events were appended between the two positions, and nothing else happened.
fn went_straight(first: LogPosition, last: LogPosition) -> bool {
    last.total.wrapping_sub(first.total) == last.next_slot.wrapping_sub(first.next_slot)
        && first.next_slot < last.next_slot
}

#[cfg(test)]
mod tests {
    use super::*;
    use ser_proto::{Inputs, Model, TimeStamp};

    fn reply(start: u16, count: usize, total: u16, next_slot: u16) -> ReadReply {
        let time = TimeStamp {
            year: 26,
            month: 11,
            day: 22,
            hour: 10,
            minute: 0,
            second: 0,
            millisecond: 250,
        };
        // Input 1 changes in each entry.
        let entry =
            |number: u16| Entry { changed: Inputs(1), state: Inputs((number % 2).into()), time };
        let entries = (start..).take(count).map(entry).collect();
        ReadReply { start, total, next_slot, model: Some(Model::Ser160), entries }
    }

    /// Reads entries 11 to 30 of 100 while the log goes from one total and next slot to the other.
    fn is_mixed(first: (u16, u16), last: (u16, u16)) -> bool {
        let mut reader = RangeReader::new(11, 20, 100);
        reader.take(&reply(11, 10, first.0, first.1), &mut drop);
        reader.take(&reply(21, 10, last.0, last.1), &mut drop);
        assert_eq!((reader.delivered(), reader.request()), (20, None));
        reader.is_mixed()
    }

    #[test]
    fn a_change_without_an_entry_is_told_between_neighbours_only() {
        let mut reply = reply(11, 4, 215, 13);
        // Input 2 changes without an entry before entry 12, and again before 14, which is the
        // oldest of the ring.
        for (entry, state) in reply.entries.iter_mut().zip([0b01, 0b10, 0b11, 0b00]) {
            entry.changed = Inputs(0b01);
            entry.state = Inputs(state);
        }
        let mut told = Vec::new();
        RangeReader::new(11, 4, 100).take(&reply, &mut |delivery| told.push(delivery));
        let lost: Vec<_> =
            told.iter().filter(|told| matches!(told, Delivery::Lost { .. })).collect();
        let input_2 = Lost::Unrecorded { inputs: Inputs(0b10) };
        assert_eq!(lost, [&Delivery::Lost { after: None, lost: input_2 }]);
        assert!(matches!(told[1], Delivery::Lost { .. }), "before entry 12");
    }

    #[test]
    fn a_change_without_an_entry_is_told_where_two_replies_meet_although_an_event_came_elsewhere() {
        let first = reply(1, 10, 20, 20);
        let mut second = reply(11, 10, 21, 21);
        // Input 2 changes without an entry before entry 11.
        second.entries[0].state = Inputs(0b11);
        let mut told = Vec::new();
        let mut reader = RangeReader::new(1, 20, 100);
        for reply in [&first, &second] {
            reader.take(reply, &mut |delivery| told.push(delivery));
        }
        let input_2 = Lost::Unrecorded { inputs: Inputs(0b10) };
        assert_eq!(told[10], Delivery::Lost { after: None, lost: input_2 });
        assert!(!reader.is_mixed());
        // The entry that overwrote the one before is not a neighbour.
        let mut told = Vec::new();
        let mut reader = RangeReader::new(1, 20, 100);
        for reply in [&reply(1, 10, 109, 9), &ReadReply { total: 110, next_slot: 10, ..second }] {
            reader.take(reply, &mut |delivery| told.push(delivery));
        }
        assert!(matches!(told[10], Delivery::Event { entry_number: 11, .. }), "{:?}", told[10]);
    }

    #[test]
    fn a_position_that_cannot_be_is_none() {
        let mut reader = RangeReader::new(1, 10, 100);
        reader.take(&reply(1, 10, u16::MAX, u16::MAX), &mut drop);
        assert!(!reader.is_seam(0) && !reader.is_seam(1));
    }

    #[test]
    fn events_that_took_the_place_of_entries_are_noticed() {
        assert!(!RangeReader::new(1, 1, 1).is_mixed());
        assert!(!is_mixed((215, 15), (215, 15)), "nothing has happened");
        assert!(!is_mixed((205, 5), (210, 10)), "before the range");
        assert!(!is_mixed((230, 30), (240, 40)), "behind the range");
        assert!(is_mixed((205, 5), (211, 11)), "its first entry");
        assert!(is_mixed((229, 29), (230, 30)), "its last entry");
        assert!(is_mixed((240, 40), (310, 10)), "over the end of the ring");
        assert!(is_mixed((205, 5), (306, 6)), "once around");
        assert!(is_mixed((205, 5), (305, 5)), "once around to the same place");
        assert!(is_mixed((205, 5), (10, 10)), "erased");
        assert!(!is_mixed((65_535, 50), (3, 54)), "over the wrap of the total, behind the range");
    }
}
