//! The list itself: the lives of all recorders, merged.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use super::bounds::Key;
use super::{EventId, Order, Timeline, event_id};

/// Something in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// An entry.
    Entry(EventId),
    /// Something is missing ahead of this entry (which may be one past the last of its life): the
    /// gap of this index in the life's list.
    Gap(EventId, usize),
    /// The recorder's clock was set ahead of this entry, or may have been.
    ClockSet(EventId),
}

/// Everything in the list, in order. Entries whose time is not known at all come last.
pub struct Items<'t> {
    timeline: &'t Timeline<'t>,
    heads: BinaryHeap<Reverse<Head>>,
    /// What comes before the next head.
    pending: Vec<Item>,
}

/// The next entry of a life. Ordered as the list is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Head {
    key: Key,
    /// Whether it is not known to be ahead of others of the same key.
    is_later: bool,
    recorder: u32,
    life: u32,
    place: u32,
    /// Whether its place rests on no guess. Asked for once: heads are looked at again for each entry
    /// of the list.
    is_sure: bool,
}

/// How many entries of doubtful run are looked at ahead of a place in the list: there are seldom
/// more than a few, and a log may hold millions.
const MOST_DOUBTFUL: usize = 256;

impl<'t> Timeline<'t> {
    /// Everything in the list, in order.
    #[must_use]
    pub fn items(&'t self) -> Items<'t> {
        let mut heads = BinaryHeap::new();
        for (recorder, of_recorder) in self.history.recorders.iter().enumerate() {
            for life in 0..of_recorder.lives.len() {
                heads.extend(self.head(event_id(recorder, life, 0)).map(Reverse));
            }
        }
        Items { timeline: self, heads, pending: Vec::new() }
    }

    /// The entries alone, in order.
    pub fn entries(&'t self) -> impl Iterator<Item = EventId> + 't {
        self.items().filter_map(|item| match item {
            Item::Entry(event) => Some(event),
            Item::Gap(..) | Item::ClockSet(_) => None,
        })
    }

    fn head(&self, event: EventId) -> Option<Head> {
        self.held(event)?;
        let key = self.key(event)?;
        let EventId { recorder, life, place } = event;
        let is_sure = self.is_surely_placed(event);
        Some(Head { key, is_later: true, recorder, life, place, is_sure })
    }

    /// Whether the place of an entry in the list rests on no guess: its run is sure, and it is not
    /// where it is because the guess for the one before it has pushed it there.
    fn is_surely_placed(&self, event: EventId) -> bool {
        let first = self.first_of_stretch(event);
        let before = first.place.checked_sub(1).map(|place| EventId { place, ..first });
        let is_pushed = before
            .is_some_and(|before| !self.is_run_sure(before) && self.key(before) == self.key(first));
        self.is_run_sure(event) && !is_pushed
    }

    /// This entry, and those after it in its log to the first one whose run is sure. What is known
    /// of that one does not bound the others before it, although they came first.
    fn doubtful_from(&self, event: EventId) -> impl Iterator<Item = EventId> {
        let mut next = Some(event);
        let follow = move || {
            let event = next.take()?;
            let after = EventId { place: event.place + 1, ..event };
            let is_doubtful = |event| !self.is_run_sure(event);
            let goes_on = self.held(after).is_some() && (is_doubtful(event) || is_doubtful(after));
            next = goes_on.then_some(after);
            Some(event)
        };
        std::iter::from_fn(follow).take(MOST_DOUBTFUL)
    }

    /// Adds gaps and clock sets that are shown ahead of an entry, the last one first.
    fn add_ahead_of(&self, event: EventId, items: &mut Vec<Item>) {
        let (Some(life), Some(clock)) = (self.life(event), self.clock(event)) else { return };
        let place = event.place as usize;
        let sequence = |place: usize| life.entries.get(place).map(|held| held.sequence);
        let previous = place.checked_sub(1).and_then(sequence);
        // A step is shown where it was at the latest, and once.
        let is_here = |before: u64| {
            previous.is_none_or(|previous| before >= previous)
                && sequence(place).is_some_and(|this| before < this)
        };
        if clock.runs.steps.iter().any(|step| is_here(step.before)) {
            items.push(Item::ClockSet(event));
        }
        let first = life.gaps.partition_point(|gap| gap.place < place);
        let end = life.gaps.partition_point(|gap| gap.place <= place);
        items.extend((first..end).rev().map(|index| Item::Gap(event, index)));
    }
}

impl Head {
    fn event(self) -> EventId {
        EventId { recorder: self.recorder, life: self.life, place: self.place }
    }
}

impl Items<'_> {
    /// Where an entry goes whose run is not sure is a guess. If another one is proven to be
    /// earlier, that one comes first, and what precedes it in its log before that.
    fn put_what_is_proven_first(&mut self) {
        if self.heads.iter().all(|Reverse(head)| head.is_sure) {
            return;
        }
        let Some(mut first) = self.heads.peek().map(|Reverse(head)| *head) else { return };
        // Each is earlier than the one before, so there is an end.
        for _ in 0..self.heads.len() {
            let is_earlier = |head: &Head| {
                (!head.is_sure || !first.is_sure)
                    && self
                        .timeline
                        .doubtful_from(head.event())
                        .any(|event| self.timeline.order(event, first.event()) == Order::Before)
            };
            let earlier = self.heads.iter().map(|Reverse(head)| *head).filter(is_earlier).min();
            let Some(earlier) = earlier else { break };
            first = earlier;
        }
        let key = self.heads.peek().map(|Reverse(head)| head.key);
        if let Some(key) = key.filter(|key| *key != first.key) {
            let mut heads = std::mem::take(&mut self.heads).into_vec();
            for Reverse(head) in
                heads.iter_mut().filter(|Reverse(head)| head.event() == first.event())
            {
                head.key = key;
                head.is_later = false;
            }
            self.heads = heads.into();
        }
    }
}

impl Iterator for Items<'_> {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        if let Some(item) = self.pending.pop() {
            return Some(item);
        }
        self.put_what_is_proven_first();
        // The next entry takes the place of this one: that is less work than to take one away and
        // to put another one in.
        let mut first = self.heads.peek_mut()?;
        let Reverse(head) = *first;
        let event = head.event();
        let next = EventId { place: head.place + 1, ..event };
        match self.timeline.head(next) {
            Some(head) => *first = Reverse(head),
            None => {
                PeekMut::pop(first);
                // What is missing at the end of a life.
                self.timeline.add_ahead_of(next, &mut self.pending);
            }
        }
        self.pending.push(Item::Entry(event));
        self.timeline.add_ahead_of(event, &mut self.pending);
        self.pending.pop()
    }
}
