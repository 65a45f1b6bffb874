//! How far a reading has come: what it knows of the log, and what it has delivered.

use ser_proto::{Entry, MAX_ENTRIES, Model};

use super::footing::Footing;
use super::growth::Growth;
use super::head::{BASE, Head, low_16};
use super::losses::Losses;
use super::outstanding::Outstanding;
use super::overrun::Overrun;
use super::read_ahead::ReadAhead;
use crate::reading::cursor::Cursor;
use crate::reading::delivery::Delivery;
use crate::reading::disturbed::Disturbed;
use crate::reading::log_position::LogPosition;
use crate::reading::read_request::ReadRequest;
use crate::reading::summary::Summary;

/// The entries of a reply.
#[derive(Clone, Copy)]
pub(super) struct Batch<'a> {
    pub(super) entries: &'a [Entry],
    pub(super) model: Model,
}

/// A reading that knows where the log stands.
#[derive(Debug)]
pub(super) struct Progress {
    pub(super) head: Head,
    /// Index of the next event to deliver.
    pub(super) next: u64,
    /// The reading is done when `next` gets here.
    pub(super) target: u64,
    pub(super) footing: Footing,
    /// Whether the anchor has been seen in its place during this reading.
    pub(super) checked: bool,
    pub(super) growth: Growth,
    pub(super) outstanding: Outstanding,
    /// What is known of the events from `next` on.
    pub(super) ahead: ReadAhead,
    /// Replies with events since the anchor was last seen in its place.
    pub(super) unproven: u64,
    /// The most entries that one reply holds.
    pub(super) most: u64,
    pub(super) overrun: Overrun,
    /// Whether the reading continues until it has caught up.
    pub(super) keeps_up: bool,
    pub(super) losses: Losses,
    pub(super) cursor: Option<Cursor>,
    /// Whether the events of this log are counted from its beginning.
    pub(super) is_exact: bool,
    pub(super) delivered: u32,
}

impl Progress {
    pub(super) fn new(head: Head, next: u64, cursor: Option<Cursor>, keeps_up: bool) -> Progress {
        Progress {
            head,
            next,
            target: head.total,
            footing: Footing::Unknown,
            checked: false,
            growth: Growth::Unasked,
            outstanding: Outstanding::default(),
            ahead: ReadAhead::default(),
            unproven: 0,
            most: MAX_ENTRIES as u64,
            overrun: Overrun::default(),
            keeps_up,
            losses: Losses::default(),
            cursor,
            is_exact: cursor.is_some_and(|cursor| cursor.is_exact),
            delivered: 0,
        }
    }

    /// Takes the header of a reply.
    pub(super) fn see_header(&mut self, position: LogPosition) -> Result<(), Disturbed> {
        let head = self.head.moved_to(position)?;
        let unread = head.total - self.next;
        if unread > u16::MAX.into() {
            return Err(Disturbed::Changed);
        }
        self.overrun.pace = head.happened.max(self.head.happened);
        self.head = head;
        // A new reading would cost a look at the anchor.
        if self.keeps_up && (self.overrun.margin > 0 || unread > MAX_ENTRIES as u64) {
            self.target = head.total;
        }
        Ok(())
    }

    /// How many events are not delivered yet, whether or not the ring still holds them.
    pub(super) fn behind(&self) -> u64 {
        self.head.total - self.next
    }

    /// Whether everything that had happened when the reading began is delivered.
    pub(super) fn is_at_target(&self) -> bool {
        // A loss is delivered with the event after it.
        self.next >= self.target && !self.losses.is_pending()
    }

    /// Forgets what was read ahead.
    pub(super) fn forget_read_ahead(&mut self) {
        self.ahead.clear();
        self.unproven = 0;
    }

    /// Gives up the events before `index`.
    pub(super) fn skip_to(&mut self, index: u64) {
        self.losses.overwritten(index - self.next);
        self.ahead.skip(index - self.next);
        self.next = index;
    }

    /// Keeps entries as events `first`, `first + 1` and so on, if these have happened and the ring
    /// still held them.
    pub(super) fn keep(&mut self, first: u64, request: ReadRequest, batch: Batch<'_>) {
        let Head { size, total, .. } = self.head;
        let len = batch.entries.len() as u64;
        if (1..u64::from(request.count)).contains(&len) && first + len < total {
            // The log holds more, so a reply takes no more entries than this.
            self.most = self.most.min(len);
        }
        for (index, &entry) in (first..total).zip(batch.entries) {
            if total - index <= size {
                self.keep_event(index, entry, batch.model);
            }
        }
    }

    /// Keeps the entry of an event, unless it is already delivered or given up.
    pub(super) fn keep_event(&mut self, index: u64, entry: Entry, model: Model) {
        let offset = index.checked_sub(self.next).and_then(|offset| usize::try_from(offset).ok());
        if let Some(offset) = offset {
            self.ahead.keep(offset, entry, model);
        }
    }

    /// Delivers event `next`, `next + 1` and so on, as far as they are known.
    pub(super) fn deliver(&mut self, on: &mut dyn FnMut(Delivery)) {
        self.unproven = 0;
        while let Some((entry, model)) = self.ahead.pop() {
            self.losses.deliver_unrecorded(self.cursor, &entry, on);
            self.losses.deliver(self.cursor, on);
            let entry_number = low_16(self.head.slot_of(self.next) + 1);
            self.next += 1;
            let sequence = self.next - BASE;
            on(Delivery::Event { entry_number, sequence: Some(sequence), entry, model });
            self.delivered = self.delivered.saturating_add(1);
            self.cursor = Some(Cursor { sequence, is_exact: self.is_exact, anchor: Some(entry) });
            // The anchor is not looked for while the reading is overrun.
            self.footing =
                if self.overrun.is_on() { Footing::RingSize } else { Footing::Anchor(entry) };
            self.checked = true;
        }
    }

    /// Delivers all known events. Missing events between them are counted if they are overwritten
    /// or given up.
    pub(super) fn deliver_past_gaps(&mut self, on: &mut dyn FnMut(Delivery)) {
        let end = self.overrun.given_up.max(self.head.oldest());
        self.deliver(on);
        // A loss is counted when the event after it is known.
        while let Some(known) = self.ahead.first_known().map(|offset| self.next + offset)
            && known <= end
        {
            self.skip_to(known);
            self.deliver(on);
        }
    }

    /// Stops looking for the anchor while the reading is overrun. What was read ahead of it waits
    /// until the ring has shown its size.
    pub(super) fn leave_anchor_if_overrun(&mut self) {
        let is_anchored = self.footing.is_anchor();
        if is_anchored && self.overrun.is_on() && self.growth != Growth::Asking {
            self.footing =
                if self.ahead.is_empty() { Footing::RingSize } else { Footing::Unconfirmed };
        }
    }

    pub(super) fn summary(&self) -> Summary {
        Summary {
            delivered: self.delivered,
            lost: self.losses.lost,
            unrecorded: self.losses.unrecorded,
            restarted: self.losses.restarted,
            position: self.head.position(),
        }
    }
}
