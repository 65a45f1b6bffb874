//! What is asked next, while replies are still to come.
//!
//! With an anchor, events are read ahead of it, up to `DEPTH` replies in all, and the anchor is
//! asked for last. If events come faster than that, requests for events and probes of the ring
//! alternate. Everything else is asked for alone.

use ser_proto::{MAX_ENTRIES, MAX_SIZE};

use super::footing::Footing;
use super::growth::Growth;
use super::head::{Head, low_16};
use super::outstanding::{Asked, Purpose};
use super::progress::Progress;
use crate::reading::read_request::ReadRequest;

/// The most replies for one look at the anchor, which thus costs one entry in this many replies.
const DEPTH: u64 = 8;

/// How far beyond the next event the requests go.
const REACH: u64 = 2 * DEPTH * MAX_ENTRIES as u64;

/// Where the reading will be when all requests are answered.
struct Expected {
    /// Index of the next event to deliver.
    next: u64,
    /// Replies that are not proven by a later one.
    unproven: u64,
}

impl Progress {
    pub(super) fn plan(&mut self) -> Option<Asked> {
        let head = self.head;
        if self.growth == Growth::Asking {
            let behind_head = entries(head.size, head.slot, MAX_ENTRIES as u64);
            return self.alone(Purpose::Probe, behind_head);
        }
        if self.overrun.is_on() && self.footing != Footing::Unknown {
            return self.plan_overrun();
        }
        let behind = self.behind();
        let rest = self.events(self.next, behind);
        match self.footing {
            Footing::Total | Footing::RingSize if self.is_at_target() => None,
            Footing::Anchor(_) if self.is_at_target() && self.checked => None,
            Footing::Anchor(_) if behind < head.size => self.plan_events(),
            Footing::Total if behind < head.size => self.alone(Purpose::Plain, rest),
            Footing::RingSize => self.alone(Purpose::Plain, rest),
            Footing::Unknown | Footing::Anchor(_) | Footing::Total | Footing::Unconfirmed => {
                self.alone(Purpose::Probe, self.probe())
            }
        }
    }

    /// Makes a request if no other reply is awaited.
    fn alone(&self, purpose: Purpose, request: ReadRequest) -> Option<Asked> {
        self.outstanding.is_empty().then_some(Asked { request, purpose })
    }

    /// Asks for events after the anchor. Events that do not fit the request for the anchor itself
    /// come first, up to `DEPTH` replies in all. The anchor and the events that do fit come last.
    fn plan_events(&self) -> Option<Asked> {
        if !self.checked && !self.outstanding.is_empty() {
            // The log may be another one.
            return None;
        }
        let expected = self.expected();
        let total = self.head.total;
        let with_anchor = self.with_anchor(expected.next);
        let all = self.outstanding.len();
        let first = self.unasked_from(expected.next + with_anchor, all);
        let within_reach = |index| index < self.target.min(self.next + REACH);
        let asked = |first, count| {
            Some(Asked { request: self.events(first, count), purpose: Purpose::Events(first) })
        };
        let is_ahead = expected.unproven + 1 < self.depth(expected.next);
        if self.checked && within_reach(first) && is_ahead {
            let count = (first..total).take_while(|&index| !self.is_known_or_asked(index, all));
            return asked(first, count.take(MAX_ENTRIES).count() as u64);
        }
        if expected.unproven > 0 || within_reach(expected.next) || !self.checked {
            let end = total.min(expected.next + with_anchor);
            let fitting =
                (expected.next..end).take_while(|&index| !self.is_known_or_asked(index, all));
            return asked(expected.next - 1, 1 + fitting.count() as u64);
        }
        None
    }

    fn expected(&self) -> Expected {
        let mut expected = Expected { next: self.next, unproven: self.unproven };
        for (place, asked) in self.outstanding.iter().enumerate() {
            let Some(events) = asked.events() else { continue };
            if events.contains(&(expected.next - 1)) {
                // This request proves the events before it.
                let next = self.unasked_from(expected.next, place + 1);
                expected = Expected { next, unproven: 0 };
            } else {
                expected.unproven += 1;
            }
        }
        expected
    }

    /// How many events fit the request that begins with the anchor, if `next` is the event after
    /// it.
    fn with_anchor(&self, next: u64) -> u64 {
        self.most.min(self.head.size - self.head.slot_of(next - 1)) - 1
    }

    /// How many replies there may be for one look at the anchor. The anchor must not be overwritten
    /// in that time if events come no faster than they can be read.
    fn depth(&self, next: u64) -> u64 {
        let least = if self.with_anchor(next) == 0 { 2 } else { 1 };
        // What is read ahead is lost with the anchor, so the faster events come, the less is read
        // ahead.
        let most = MAX_ENTRIES as u64;
        let pace = self.overrun.pace;
        let per_reply = if pace > most { 2 * pace } else { most };
        ((next - 1).saturating_sub(self.head.oldest()) / per_reply).clamp(least, DEPTH)
    }

    /// Asks for events and for the size of the ring in turn, each while the other reply is on the
    /// line.
    fn plan_overrun(&mut self) -> Option<Asked> {
        let is_probe = |asked: &Asked| asked.purpose == Purpose::Probe;
        let is_probing = self.outstanding.iter().any(is_probe);
        let is_reading = self.outstanding.iter().any(|asked| !is_probe(asked));
        if !is_probing && (is_reading || self.footing == Footing::Unconfirmed) {
            return Some(Asked { request: self.probe(), purpose: Purpose::Probe });
        }
        let all = self.outstanding.len();
        let begin = self.next.max(self.overrun.given_up);
        let first = self.unasked_from(begin, all);
        // A loss is delivered with the event after it. So is what was given up: as long as no later
        // event is known or asked for, the reading has not come past it.
        let is_past_loss = !self.losses.is_pending() && (first > begin || self.next >= self.target);
        if is_reading || (first >= self.target && is_past_loss) {
            return None;
        }
        let first = self.overrun.worth_asking_from(first, self.head);
        let request = self.events(first.min(self.head.total), MAX_ENTRIES as u64);
        Some(Asked { request, purpose: Purpose::Overrun })
    }

    /// The first event from `index` on that is neither known nor asked for by the first `requests`
    /// requests.
    fn unasked_from(&self, index: u64, requests: usize) -> u64 {
        (index..).find(|&index| !self.is_known_or_asked(index, requests)).unwrap_or(index)
    }

    fn is_known_or_asked(&self, index: u64, requests: usize) -> bool {
        let offset = index.checked_sub(self.next);
        let is_known = offset.is_some_and(|offset| self.ahead.knows(offset));
        is_known || self.outstanding.asks_for(index, requests)
    }

    /// Asks for `count` events from `index` on, as far as one request reaches.
    fn events(&self, index: u64, count: u64) -> ReadRequest {
        entries(self.head.size, self.head.slot_of(index), count.min(self.most))
    }

    /// Asks for the last entry of the ring and for one more, which must not exist.
    fn probe(&self) -> ReadRequest {
        let Head { size, .. } = self.head;
        let count = if size < MAX_SIZE.into() { 2 } else { 1 };
        ReadRequest { start: low_16(size), count }
    }
}

/// Asks for `count` entries from `slot` on, as far as one request reaches in a ring of `size`
/// entries.
pub(super) fn entries(size: u64, slot: u64, count: u64) -> ReadRequest {
    let count = count.min(size - slot).clamp(1, MAX_ENTRIES as u64);
    ReadRequest { start: low_16(slot + 1), count: u8::try_from(count).unwrap_or(1) }
}
