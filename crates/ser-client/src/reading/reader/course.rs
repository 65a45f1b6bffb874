//! What to ask for next, while answers are still to come.

use std::ops::Range;

use ser_proto::{MAX_ENTRIES, MAX_SIZE};

use super::super::log_position::LogPosition;
use super::super::read_request::ReadRequest;
use super::{Asked, Footing, Growth, Head, LogReader, Pending, Purpose, low_16};

/// Replies for one look at the anchor, at most: it costs one entry in so many replies.
const DEPTH: u64 = 8;

/// How far beyond the events that are delivered next others are asked for.
const REACH: u64 = 2 * DEPTH * MAX_ENTRIES as u64;

/// Where the reading will be when everything that was asked for has come.
struct Course {
    /// Index of the next event to deliver.
    next: u64,
    /// Replies that no later one has proven.
    unproven: u64,
}

impl LogReader {
    pub(super) fn plan(&mut self) -> Option<Asked> {
        let alone = |purpose, request| self.asked.is_empty().then_some(Asked { request, purpose });
        let Some(head) = self.head else {
            // Where the last entry that was delivered probably is.
            let last_slot = |near: LogPosition| (u64::from(near.next_slot) + self.size - 1) % self.size;
            let position = self.near.map_or(ReadRequest::POSITION, |near| self.entries(last_slot(near), 2));
            return alone(Purpose::Locate, position);
        };
        if self.growth == Growth::Asking {
            return alone(Purpose::Probe, self.entries(head.slot, MAX_ENTRIES as u64));
        }
        if self.is_in_haste() && self.footing != Footing::Uncounted {
            return self.plan_in_haste(head);
        }
        let behind = head.total - self.next;
        let at_target = self.next >= self.target && self.pending == Pending::default();
        match self.footing {
            Footing::Loose | Footing::Firm if at_target => None,
            Footing::Anchored(_) if at_target && self.checked => None,
            Footing::Anchored(_) if behind < self.size => self.next_events(head),
            Footing::Loose if behind < self.size => {
                alone(Purpose::Plain, self.events(head, self.next, behind))
            }
            Footing::Firm => alone(Purpose::Plain, self.events(head, self.next, behind)),
            Footing::Uncounted | Footing::Anchored(_) | Footing::Loose | Footing::Held => {
                alone(Purpose::Probe, self.probe())
            }
        }
    }

    /// Asks for events that come after the anchor: first for those that do not fit the request for the anchor itself,
    /// up to `DEPTH` replies in all, and then for the anchor and what does fit.
    fn next_events(&self, head: Head) -> Option<Asked> {
        if !self.checked && !self.asked.is_empty() {
            // It may be another log.
            return None;
        }
        let course = self.course();
        let with_anchor = self.with_anchor(head, course.next);
        let all = self.asked.len();
        let first = self.unasked_from(course.next + with_anchor, all);
        let within_reach = |index| index < self.target.min(self.next + REACH);
        let asked = |first, count| {
            Some(Asked { request: self.events(head, first, count), purpose: Purpose::Events(first) })
        };
        if self.checked && within_reach(first) && course.unproven + 1 < self.depth(head, course.next) {
            let count = (first..head.total).take_while(|&index| !self.is_known_or_asked(index, all));
            return asked(first, count.take(MAX_ENTRIES).count() as u64);
        }
        if course.unproven > 0 || within_reach(course.next) || !self.checked {
            let end = head.total.min(course.next + with_anchor);
            let fitting = (course.next..end).take_while(|&index| !self.is_known_or_asked(index, all));
            return asked(course.next - 1, 1 + fitting.count() as u64);
        }
        None
    }

    fn course(&self) -> Course {
        let mut course = Course { next: self.next, unproven: self.unproven };
        for (place, asked) in self.asked.iter().enumerate() {
            let Some(events) = asked.events() else { continue };
            if events.contains(&(course.next - 1)) {
                // It proves what comes before it.
                course = Course { next: self.unasked_from(course.next, place + 1), unproven: 0 };
            } else {
                course.unproven += 1;
            }
        }
        course
    }

    /// How many events after the anchor fit the request that begins with it.
    fn with_anchor(&self, head: Head, next: u64) -> u64 {
        self.most.min(self.size - self.slot_of(head, next - 1)) - 1
    }

    /// Replies for one look at the anchor. As long as events come no faster than they can be read, the anchor must not
    /// be overwritten meanwhile.
    fn depth(&self, head: Head, next: u64) -> u64 {
        let oldest = head.total - self.size;
        let least = if self.with_anchor(head, next) == 0 { 2 } else { 1 };
        // What is read ahead is lost with the anchor: the faster events come, the less is risked.
        let most = MAX_ENTRIES as u64;
        let per_reply = if self.pace > most { 2 * self.pace } else { most };
        ((next - 1).saturating_sub(oldest) / per_reply).clamp(least, DEPTH)
    }

    /// The first event from `index` on that is neither known nor asked for by the first `requests`.
    pub(super) fn unasked_from(&self, index: u64, requests: usize) -> u64 {
        (index..).find(|&index| !self.is_known_or_asked(index, requests)).unwrap_or(index)
    }

    fn is_known_or_asked(&self, index: u64, requests: usize) -> bool {
        let is_known = index.checked_sub(self.next).is_some_and(|offset| self.ahead.knows(offset));
        let is_asked = |asked: &Asked| asked.events().is_some_and(|events| events.contains(&index));
        is_known || self.asked.iter().take(requests).any(is_asked)
    }

    /// Asks for `count` events from `index` on, as far as one request goes.
    pub(super) fn events(&self, head: Head, index: u64, count: u64) -> ReadRequest {
        self.entries(self.slot_of(head, index), count.min(self.most))
    }

    /// Asks for the last entry of the ring, and for one more that must not exist.
    pub(super) fn probe(&self) -> ReadRequest {
        let count = if self.size < MAX_SIZE.into() { 2 } else { 1 };
        ReadRequest { start: low_16(self.size), count }
    }

    /// Asks for `count` entries from `slot` on, as far as one request goes.
    fn entries(&self, slot: u64, count: u64) -> ReadRequest {
        let count = count.min(self.size - slot).clamp(1, MAX_ENTRIES as u64);
        ReadRequest { start: low_16(slot + 1), count: u8::try_from(count).unwrap_or(1) }
    }
}

impl Asked {
    /// The events that are asked for, if it is events.
    fn events(&self) -> Option<Range<u64>> {
        match self.purpose {
            Purpose::Events(first) => Some(first..first + u64::from(self.request.count)),
            _ => None,
        }
    }
}
