//! Reading a log by cursor: which entries to ask for next, and what the answers mean.
//!
//! [`LogReader`] delivers every event once and in order: across the end of the ring, across the wrap of the 16-bit
//! total, and with events arriving meanwhile. What the recorder overwrote before it could be read is counted exactly.
//! The reader performs no I/O: send what [`request`](LogReader::request) asks for, hand in the replies with
//! [`take`](LogReader::take), and so on until there is no request any more and no reply is to come. One request at a
//! time will do; with two, the next reply can follow the last one without a gap.
//!
//! # How it works
//!
//! Events have a running index, 0 for the first after an erase. A recorder with total `T` and next slot `S` keeps
//! event `q` in slot `(S - (T - q)) mod size`, and has overwritten it once `T - q > size`. Every reply carries `T` and
//! `S` of the very moment at which its entries were copied, so for each entry it is certain which event it is, as long
//! as the log is the same as before.
//!
//! That it is, only an entry can tell: after an erase, totals and slots may agree by chance with what recording would
//! have made of them. So nothing is delivered before a reply has shown the *anchor*, the last event that was
//! delivered, in its place (the first events of all have none, and stand on totals and slots). An erase takes the
//! anchor away for good, since what is recorded later has another time. If the anchor is there in a reply, nothing
//! was erased between the reply that brought it first and this one; and what was copied between these two, in
//! whichever order it was asked for, is of the same log. Replies have to be taken in the order in which they were
//! copied, and that is all that this argument needs: requests may overlap, be lost, be repeated.
//!
//! Up to nine events fit the reply that begins with the anchor, and if there are no more, one request is all. If
//! there are more, those that do not fit are asked for first, up to seven replies, and are kept; then comes the
//! request for the anchor and the events right after it, and its reply proves all of them. So the proof costs one
//! entry in eighty. Where the end of the ring leaves the anchor alone in its request, it is the same.
//!
//! Reading ahead must not cost the oldest events their lives. It goes only so far that the anchor, next to be
//! overwritten, is still there as long as events come no faster than they are read.
//!
//! If another entry is in the place of the anchor, or none, the log was erased or lost its contents, and reading
//! begins anew with [`Lost::LogRestarted`]. Where the anchor is overwritten itself, the log must be full, which the
//! entry with the highest number shows: if it does not exist, the log was erased (or the ring was made larger; then
//! total and next slot do not agree, and what the resize threw away is counted). Without an anchor, only the size of
//! the ring tells which event an entry is. So what is read then is kept until the entry with the highest number has
//! been asked for once more, and nobody can have resized the ring in between.
//!
//! A reading ends when everything that had happened when it began is delivered, so it ends also when events come
//! faster than they can be read. Events that come meanwhile are delivered when they fit the same replies. A program
//! that follows a log without end [keeps up](LogReader::keeping_up) instead.
//!
//! # When events come faster than they can be read
//!
//! Then the anchor is overwritten again and again, and to look for it would be all that the line does. So the reader
//! takes whatever the ring holds: it asks for ten entries some way ahead of the oldest, and while these are on the
//! line, for the entry with the highest number. From total and next slot in each reply follows which events the
//! entries are; from the highest number that the ring still has its size. About one byte in seven goes into the
//! proof, the rest into events. They are delivered in stretches, and what is missing between them is counted.
//!
//! Between two neighbouring entries the inputs that changed must lead from one state to the other. Where they do not,
//! something changed without an entry, because recording was stopped or the recorder could not take all changes:
//! [`Lost::Unrecorded`].
//!
//! # What cannot be known
//!
//! - The total counts modulo 65536. If more than 65,535 events happen between two readings, the count of lost ones is
//!   too low by a multiple of 65536; and where the total makes it seem that the anchor must still be there, the log
//!   seems to have begun anew.
//! - An erase, or a loss of power, that is followed by at least as many events as the log holds, before the next look
//!   at the anchor, looks like overwriting. The events are delivered; the count of lost ones is that of the totals,
//!   whatever it is worth.
//! - An event that is recorded after an erase, in the slot of the anchor, with its inputs and, since the clock was
//!   set back, with its time, passes for it.
//! - A log that was empty has no anchor. Events that came and were erased before the next reading leave no trace.
//! - The first reading of a log cannot know how often the total has wrapped: [`Lost::OverwrittenAtLeast`].
//! - When events come so fast that the oldest entries are overwritten while the request for them is on its way, or
//!   while the ring is looked at once more, the reader gives up some more of the oldest, to get ahead of the recorder.
//!   They are counted as lost like the rest.
//! - A resize of which nobody knows, before the first reading of a program, puts another entry in the place of the
//!   anchor, and looks as if the log had begun anew.
//! - A resize in the middle of a reading shows when total and next slot part, when the anchor is in another place, or
//!   when the ring has not the size any more that it had before the anchor was given up. Where several resizes follow
//!   each other within one reading and end where they began, all of this may agree by chance, and an entry be taken for
//!   another: the events are right, and the count of the lost ones between them is not.
//! - Whether the ring has its size, replies of one entry do not show. All units known make room for more.
//!
//! The size of the ring must be right. An original unit does not tell it.

mod ahead;
mod course;
mod haste;

use std::collections::VecDeque;

use ser_proto::{Entry, MAX_ENTRIES, MAX_SIZE, Model, ReadReply};

use super::cursor::Cursor;
use super::delivery::{Delivery, Lost};
pub use super::disturbed::Disturbed;
use super::log_position::LogPosition;
pub use super::read_request::ReadRequest;
pub use super::summary::Summary;
use ahead::Ahead;

/// The index that total 0 gets in the arithmetic here, large enough that nothing ever goes below zero.
const BASE: u64 = 1 << 32;

/// Totals are shown modulo this.
const TOTAL_WRAPS_AT: u64 = 1 << 16;

/// Sequences that leave room for the arithmetic here: no recorder will ever count so far.
const MAX_SEQUENCE: u64 = 1 << 62;

/// Events between two replies of a reading that are believed: half of what the total can tell, half a minute at the
/// most that a recorder can do.
const MAX_HAPPENED: u64 = 1 << 15;

/// How many times the events of one request a reader gives up that events come too fast for, to get ahead of the
/// recorder: as many come while it reads and while it looks at the ring once more, and then it must not be behind.
const HASTE: u64 = 4;

/// A reading needs a few replies now and then that bring no event; so many in a row mean that something is wrong.
const MAX_FRUITLESS: u32 = 32;

/// The head of the log in the latest reply: index and slot of the next event.
#[derive(Clone, Copy, Debug)]
struct Head {
    total: u64,
    slot: u64,
    /// How many events it moved by since the reply before.
    happened: u64,
}

impl Head {
    /// Whether there are as many entries as events, so that all are there and the ring has not gone round.
    fn holds_all(&self) -> bool {
        low_16(self.total) == low_16(self.slot)
    }
}

/// What makes us believe that `next` is what follows what was delivered.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Footing {
    /// Nothing: it is not known either how many entries the log holds.
    Uncounted,
    /// This is event `next - 1`.
    Anchored(Entry),
    /// Nothing but the total.
    Loose,
    /// The latest reply has shown it.
    Firm,
    /// The size of the ring. What follows has been read, and is delivered once the ring has shown its size again.
    Held,
}

/// What was lost since the last delivery. It is delivered with the next event: if the reading ends before, the cursor
/// has not moved past it and the next reading finds it again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pending {
    restarted: bool,
    /// The log is read for the first time, from its beginning or from the oldest event that it holds.
    begun: bool,
    /// Overwritten before the log was first seen.
    at_least: u64,
    overwritten: u64,
}

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Locate,
    /// Whether the log is full: does the last entry of the ring exist?
    Probe,
    /// Events from `next` on that are delivered at once.
    Plain,
    /// Events from this index on. Those from `next` on are kept until an answer brings the anchor, too.
    Events(u64),
    /// Events that come faster than they can be read: whatever is in these slots by then.
    Haste,
    /// Nothing any more: the log has begun anew.
    Nothing,
}

/// A request whose answer has not come.
#[derive(Clone, Copy, Debug)]
struct Asked {
    request: ReadRequest,
    purpose: Purpose,
}

/// A log that is not full and has had more events than it holds was made larger, or does not have the size that
/// was given. If there is an entry behind the next slot, the ring goes round earlier than it should.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Growth {
    Unasked,
    Asking,
    Certain,
}

/// One reading from a cursor to the end of the log; see the [module documentation](self).
#[derive(Debug)]
pub struct LogReader {
    size: u64,
    cursor: Option<Cursor>,
    /// Where the log stood at the end of the reading before.
    near: Option<LogPosition>,
    head: Option<Head>,
    /// Index of the next event to deliver, up to date with `head`.
    next: u64,
    /// The reading is done when `next` is here.
    target: u64,
    footing: Footing,
    /// Whether the anchor has been seen in its place during this reading.
    checked: bool,
    /// Whether a log that is not full holds fewer entries than events because its ring was made larger.
    growth: Growth,
    pending: Pending,
    /// In the order in which they were asked.
    asked: VecDeque<Asked>,
    /// What is known of the events from `next` on.
    ahead: Ahead,
    /// Replies that have brought events since the anchor was last seen in its place.
    unproven: u64,
    /// The most entries that a reply brings.
    most: u64,
    /// How far ahead of the oldest entry reading goes on after a loss; above 0 once the recorder was faster.
    margin: u64,
    /// Events that came between two of the latest replies.
    pace: u64,
    /// Events before this index are not waited for, whether they are still there or not.
    given_up: u64,
    /// Whether a reading that is overrun goes on until it has caught up.
    keeps_up: bool,
    fruitless: u32,
    delivered: u32,
    lost: u32,
    unrecorded: u32,
    restarted: bool,
    /// Whether the events of this log are counted from its beginning.
    is_exact: bool,
}

impl LogReader {
    /// Reads what has happened since `cursor`, or everything, from a log of `size` entries (1–2048; what is outside
    /// is taken for the nearest).
    #[must_use]
    pub fn new(cursor: Option<Cursor>, size: u16) -> LogReader {
        LogReader {
            size: size.clamp(1, MAX_SIZE).into(),
            cursor,
            near: None,
            head: None,
            next: 0,
            target: 0,
            footing: Footing::Uncounted,
            checked: false,
            growth: Growth::Unasked,
            pending: Pending::default(),
            asked: VecDeque::new(),
            ahead: Ahead::default(),
            unproven: 0,
            most: MAX_ENTRIES as u64,
            margin: 0,
            pace: 0,
            given_up: 0,
            keeps_up: false,
            fruitless: 0,
            delivered: 0,
            lost: 0,
            unrecorded: 0,
            restarted: false,
            is_exact: cursor.is_some_and(|cursor| cursor.is_exact),
        }
    }

    /// Uses the position in which an earlier reading ended: if nothing has happened since, one request will do
    /// instead of two, and a ring that goes round earlier or later than it did then has another size, or was erased:
    /// [`Disturbed::Changed`]. So has one whose position belongs to another cursor.
    #[must_use]
    pub fn starting_near(mut self, position: LogPosition) -> LogReader {
        let in_ring = u64::from(position.next_slot) < self.size;
        if in_ring && self.cursor.is_some_and(|cursor| cursor.anchor.is_some()) {
            self.near = Some(position);
        }
        self
    }

    /// A reading ends when it has come past what had happened when it began. With this it goes on for as long as there
    /// is enough for a full reply, and so does not have to find its place again and again while events come fast.
    #[must_use]
    pub fn keeping_up(self, keeps_up: bool) -> LogReader {
        LogReader { keeps_up, ..self }
    }

    /// The entries to ask for next, each time others: several requests may be under way. `None` if there are none
    /// before an answer comes; the reading is done when none [is awaited](Self::is_waiting) either.
    pub fn request(&mut self) -> Option<ReadRequest> {
        let asked = self.plan()?;
        // By its start an answer is known.
        if self.asked.iter().any(|other| other.request.start == asked.request.start) {
            return None;
        }
        self.asked.push_back(asked);
        Some(asked.request)
    }

    /// Whether an answer is still to come.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        !self.asked.is_empty()
    }

    /// Takes the reply to a [`request`](Self::request) and delivers what it brings, or what it proves. Replies have to
    /// be taken in the order in which the recorder sent them, which may be another one than that of the requests. A
    /// reply that begins with an entry that no request begins with is ignored.
    ///
    /// # Errors
    /// See [`Disturbed`].
    pub fn take(&mut self, reply: &ReadReply, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        let place = self.asked.iter().position(|asked| asked.request.start == reply.start);
        let Some(Asked { request, purpose }) = place.and_then(|place| self.asked.remove(place)) else {
            return Ok(());
        };
        let delivered_before = self.delivered;
        let asked_for = reply.entries.len().min(request.count.into());
        let entries = reply.entries.get(..asked_for).unwrap_or_default();
        let batch = Batch { entries, model: reply.model.unwrap_or(Model::Ser160) };
        self.see_head(LogPosition::from(reply))?;
        match purpose {
            Purpose::Nothing => return Ok(()),
            Purpose::Locate => self.located(request, batch, on)?,
            Purpose::Probe => self.probed(request, entries.len(), on)?,
            Purpose::Plain => self.take_plain(request, batch, on)?,
            Purpose::Haste => self.take_in_haste(request, batch),
            Purpose::Events(first) => self.take_events(first, request, batch, on)?,
        }
        self.stop_looking_for_anchor();
        self.fruitless = if self.delivered == delivered_before { self.fruitless + 1 } else { 0 };
        if self.fruitless > MAX_FRUITLESS { Err(Disturbed::NoProgress) } else { Ok(()) }
    }

    /// Where the next reading has to begin; it only ever moves past what was delivered.
    #[must_use]
    pub const fn cursor(&self) -> Option<Cursor> {
        self.cursor
    }

    /// How many events the log is known to hold that are not delivered yet.
    #[must_use]
    pub fn pending(&self) -> u32 {
        let pending = self.head.map_or(0, |head| (head.total - self.next).min(self.size));
        u32::try_from(pending).unwrap_or(u32::MAX)
    }

    /// What the reading came to so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary {
            delivered: self.delivered,
            lost: self.lost,
            unrecorded: self.unrecorded,
            restarted: self.restarted,
            position: self.head.map_or(LogPosition { total: 0, next_slot: 0 }, |head| LogPosition {
                total: low_16(head.total),
                next_slot: low_16(head.slot),
            }),
        }
    }

    /// The slot of event `index`, which is at most one ring behind the head.
    fn slot_of(&self, head: Head, index: u64) -> u64 {
        (head.slot + self.size - (head.total - index) % self.size) % self.size
    }

    fn behind(&self) -> u64 {
        self.head.map_or(0, |head| head.total - self.next)
    }

    fn see_head(&mut self, position: LogPosition) -> Result<(), Disturbed> {
        let slot = u64::from(position.next_slot);
        if slot >= self.size {
            // A ring that has just been made larger shows in the same way.
            return Err(Disturbed::WrongSize);
        }
        let Some(head) = self.head else {
            let goes_on = |near: LogPosition| {
                let happened = position.total.wrapping_sub(near.total);
                slot == (u64::from(near.next_slot) + u64::from(happened)) % self.size
            };
            if !self.near.is_none_or(goes_on) {
                return Err(Disturbed::Changed);
            }
            let read_up_to = self.cursor.map_or(position.total.into(), |cursor| cursor.sequence);
            // A sequence from outside may be anything.
            self.next = BASE + read_up_to.min(MAX_SEQUENCE);
            let total = self.next + u64::from(position.total.wrapping_sub(low_16(self.next)));
            self.head = Some(Head { total, slot, happened: 0 });
            self.target = total;
            return Ok(());
        };
        let happened = u64::from(position.total.wrapping_sub(low_16(head.total)));
        let total = head.total + happened;
        // A total that went back looks as if almost 65536 events had happened. Where so many have indeed, between two
        // replies, a reading from the cursor on sorts it out as well.
        let went_back = happened > MAX_HAPPENED || total - self.next > u16::MAX.into();
        if slot != (head.slot + happened) % self.size || went_back {
            return Err(Disturbed::Changed);
        }
        self.pace = happened.max(head.happened);
        self.head = Some(Head { total, slot, happened });
        // A new reading would cost a look at the anchor.
        if self.keeps_up && (self.margin > 0 || total - self.next > MAX_ENTRIES as u64) {
            self.target = total;
        }
        Ok(())
    }

    fn located(
        &mut self,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let (Some(cursor), Some(head)) = (self.cursor, self.head) else { return Ok(()) };
        let Some(anchor) = cursor.anchor else {
            self.footing = Footing::Loose;
            // The log was empty when it was read last, so the total tells how many entries there are, if it has not
            // counted once around; and total and next slot part, if the ring has gone round, or was resized.
            let behind = self.behind();
            if cursor.total() == 0 && behind == 0 && !batch.entries.is_empty() {
                self.restart();
            } else if cursor.total() == 0 && behind < self.size && !head.holds_all() {
                self.footing = Footing::Uncounted;
            }
            return Ok(());
        };
        self.footing = Footing::Anchored(anchor);
        let anchor_entry = self.slot_of(head, self.next - 1) + 1;
        if self.near.is_some() && u64::from(request.start) == anchor_entry {
            return self.take_events(self.next - 1, request, batch, on);
        }
        Ok(())
    }

    fn probed(
        &mut self,
        request: ReadRequest,
        entries: usize,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let Some(head) = self.head else { return Ok(()) };
        if self.growth == Growth::Asking {
            // Events may have come into these slots meanwhile; any entry behind them is from the round before.
            let end = u64::from(request.start) - 1 + entries as u64;
            if end > head.slot {
                return Err(Disturbed::WrongSize);
            }
            if entries == usize::from(request.count) {
                return Ok(());
            }
            self.growth = Growth::Certain;
            return match self.footing {
                Footing::Uncounted => self.count(head, head.slot, on),
                _ => self.not_full(head, on),
            };
        }
        if entries > 1 {
            return Err(Disturbed::WrongSize);
        }
        let full = entries == 1;
        if self.footing == Footing::Uncounted {
            if !full && !self.may_hold_fewer_than(head) {
                return Ok(());
            }
            return self.count(head, if full { self.size } else { head.slot }, on);
        }
        if !full {
            return self.not_full(head, on);
        }
        if self.footing == Footing::Held || self.is_in_haste() {
            self.footing = Footing::Firm;
            self.deliver_past_gaps(on);
            if self.behind() < self.size || self.next >= self.target || self.is_in_haste() {
                return Ok(());
            }
            self.margin = self.margin.max(HASTE * head.happened);
        } else if self.behind() < self.size {
            // It was asked in haste, which is over.
            return Ok(());
        } else if self.pace >= MAX_ENTRIES as u64 && (self.checked || self.keeps_up) {
            // A moment ago nothing was lost, and events go on coming faster than they are read.
            self.margin = self.margin.max(HASTE * self.pace);
        }
        // What was read ahead cannot be proven any more: it may be of a log that is gone.
        self.ahead.clear();
        self.unproven = 0;
        self.skip_to(head.total - self.size + self.margin.min(self.size / 2));
        self.footing = Footing::Firm;
        Ok(())
    }

    /// Begins a log of which nothing is known but that it holds `held` entries.
    fn count(&mut self, head: Head, held: u64, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        if held == 0 && low_16(head.total) != 0 {
            return Err(Disturbed::WrongSize);
        }
        // Of a log that is seen for the first time only the total is known. Where it is less than what the log holds,
        // it has wrapped.
        let shown = u64::from(low_16(head.total));
        let total = BASE + if shown < held { shown + TOTAL_WRAPS_AT } else { shown };
        self.head = Some(Head { total, ..head });
        self.next = total - held;
        self.target = total;
        self.is_exact = held < self.size && shown == held;
        self.pending.begun = true;
        self.pending.at_least = self.next - BASE;
        self.footing = Footing::Firm;
        if held == 0 {
            self.deliver_losses(on);
            self.cursor = Some(Cursor { sequence: total - BASE, is_exact: self.is_exact, anchor: None });
        }
        Ok(())
    }

    /// The log is not full: entries 1 … next slot exist, and no others.
    fn not_full(&mut self, head: Head, on: &mut dyn FnMut(Delivery)) -> Result<(), Disturbed> {
        let held = head.slot;
        let behind = head.total - self.next;
        let anchored = matches!(self.footing, Footing::Anchored(_));
        // Nothing has been thrown away since the erase, so the anchor would be there.
        if head.holds_all() && (anchored || behind > held) {
            self.restart();
            return Ok(());
        }
        if held == 0 {
            return Err(Disturbed::WrongSize);
        }
        let all_there = self.footing == Footing::Held && behind <= held;
        if !all_there {
            self.ahead.clear();
        }
        if !self.may_hold_fewer_than(head) {
            return Ok(());
        }
        self.footing = Footing::Firm;
        if all_there {
            self.deliver(on);
            return Ok(());
        }
        // A larger ring than before, and what did not fit the smaller one is gone.
        self.skip_to(self.next.max(head.total - held));
        Ok(())
    }

    /// Whether a log that is not full can be believed to hold fewer entries than it has had events. If that is not
    /// known, it is asked next.
    fn may_hold_fewer_than(&mut self, head: Head) -> bool {
        if !head.holds_all() && self.growth == Growth::Unasked {
            self.growth = Growth::Asking;
        }
        head.holds_all() || self.growth == Growth::Certain
    }

    fn restart(&mut self) {
        // What was counted for the log that is gone is worth nothing.
        self.pending = Pending { restarted: self.cursor.is_some(), ..Pending::default() };
        self.footing = Footing::Uncounted;
        self.is_exact = false;
        self.margin = 0;
        self.given_up = 0;
        self.ahead.clear();
        self.unproven = 0;
        self.most = MAX_ENTRIES as u64;
        self.asked.iter_mut().for_each(|asked| asked.purpose = Purpose::Nothing);
        self.next = self.head.map_or(self.next, |head| head.total);
    }

    fn skip_to(&mut self, index: u64) {
        self.pending.overwritten += index - self.next;
        self.ahead.skip(index - self.next);
        self.next = index;
    }

    /// Takes events from index `first` on. If the anchor is among them and in its place, everything that was read
    /// before its turn is of the same log and is delivered.
    fn take_events(
        &mut self,
        first: u64,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let Some(head) = self.head else { return Ok(()) };
        let mut proven = false;
        let asked_for = first..first + u64::from(request.count);
        // If the anchor has been overwritten meanwhile, the next step is to ask whether the log is full.
        if let Footing::Anchored(anchor) = self.footing
            && asked_for.contains(&(self.next - 1))
            && self.behind() < self.size
        {
            let found = usize::try_from(self.next - 1 - first).ok().and_then(|at| batch.entries.get(at));
            match found {
                // The log is shorter than it must be, or the reply is.
                None if batch.entries.is_empty() => return self.not_full(head, on),
                None => {}
                // It was there a moment ago. Perhaps the ring was resized and the slots mean something else now.
                Some(found) if *found != anchor && self.checked => return Err(Disturbed::Changed),
                Some(found) if *found != anchor => {
                    self.restart();
                    return Ok(());
                }
                Some(_) => {
                    self.checked = true;
                    proven = true;
                }
            }
        } else if batch.entries.is_empty() {
            // There are events in these slots, if the ring is what it was.
            return Err(Disturbed::Changed);
        }
        self.keep(first, request, batch);
        if proven {
            self.deliver(on);
        } else if self.is_in_haste() {
            self.footing = Footing::Held;
        } else {
            self.unproven += 1;
        }
        Ok(())
    }

    /// Keeps entries that are events `first`, `first + 1` and so on, as far as these have happened and were there
    /// still.
    fn keep(&mut self, first: u64, request: ReadRequest, batch: Batch<'_>) {
        let Some(head) = self.head else { return };
        let len = batch.entries.len() as u64;
        if (1..u64::from(request.count)).contains(&len) && first + len < head.total {
            // More there were, so this is all that a message takes here.
            self.most = self.most.min(len);
        }
        for (index, &entry) in (first..head.total).zip(batch.entries) {
            let offset = index.checked_sub(self.next).and_then(|offset| usize::try_from(offset).ok());
            if let Some(offset) = offset.filter(|_| head.total - index <= self.size) {
                self.ahead.keep(offset, entry, batch.model);
            }
        }
    }

    fn take_plain(
        &mut self,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let Some(head) = self.head else { return Ok(()) };
        if batch.entries.is_empty() {
            return self.not_full(head, on);
        }
        self.footing = Footing::Loose;
        let overwritten = self.behind().saturating_sub(self.size);
        if overwritten < batch.entries.len() as u64 {
            self.keep(self.next, request, batch);
            self.skip_to(self.next + overwritten);
            self.deliver_or_hold(head, on);
            return Ok(());
        }
        // Everything asked for was overwritten on the way, it seems.
        if self.margin < self.size {
            self.margin = self.margin.max(HASTE * head.happened);
            return Ok(());
        }
        // The ring turns over during one request, and is still the same: whatever the reply holds is all that can be
        // had.
        let slot = u64::from(request.start) - 1;
        let age = (head.slot + self.size - slot - 1) % self.size;
        self.skip_to(self.next.max(head.total - 1 - age));
        self.keep(self.next, request, batch);
        self.deliver_or_hold(head, on);
        Ok(())
    }

    /// Delivers what has been read without the anchor, which is gone or has never been. Where the ring has gone round,
    /// its size has to be shown once more before: somebody may have changed it.
    fn deliver_or_hold(&mut self, head: Head, on: &mut dyn FnMut(Delivery)) {
        if head.holds_all() {
            self.deliver(on);
        } else {
            self.footing = Footing::Held;
            self.growth = Growth::Unasked;
        }
    }

    /// Delivers what is known of event `next`, `next + 1` and so on.
    fn deliver(&mut self, on: &mut dyn FnMut(Delivery)) {
        let Some(head) = self.head else { return };
        self.unproven = 0;
        while let Some((entry, model)) = self.ahead.pop() {
            self.find_unrecorded(&entry, on);
            self.deliver_losses(on);
            let entry_number = low_16(self.slot_of(head, self.next) + 1);
            self.next += 1;
            let sequence = self.next - BASE;
            on(Delivery::Event { entry_number, sequence: Some(sequence), entry, model });
            self.delivered = self.delivered.saturating_add(1);
            self.cursor = Some(Cursor { sequence, is_exact: self.is_exact, anchor: Some(entry) });
            // In haste there is no time to look whether the anchor is still there.
            self.footing = if self.is_in_haste() { Footing::Firm } else { Footing::Anchored(entry) };
            self.checked = true;
        }
    }

    /// Tells of what changed between the last event and the one that is delivered next, if that is its neighbour.
    fn find_unrecorded(&mut self, next: &Entry, on: &mut dyn FnMut(Delivery)) {
        let Some(Cursor { sequence, anchor: Some(anchor), .. }) = self.cursor else { return };
        if self.pending == Pending::default()
            && let Some(lost) = Lost::between(&anchor, next)
        {
            self.unrecorded = self.unrecorded.saturating_add(1);
            on(Delivery::Lost { after: Some(sequence), lost });
        }
    }

    fn deliver_losses(&mut self, on: &mut dyn FnMut(Delivery)) {
        let Pending { restarted, begun, at_least, overwritten } = std::mem::take(&mut self.pending);
        let last_read = self.cursor.map_or(0, |cursor| cursor.sequence);
        if restarted {
            self.restarted = true;
            on(Delivery::Lost { after: Some(last_read), lost: Lost::LogRestarted });
        }
        let after = Some(if begun { 0 } else { last_read });
        let count = u32::try_from(at_least + overwritten).unwrap_or(u32::MAX);
        self.lost = self.lost.saturating_add(count);
        if at_least > 0 {
            on(Delivery::Lost { after, lost: Lost::OverwrittenAtLeast { count } });
        } else if overwritten > 0 {
            on(Delivery::Lost { after, lost: Lost::Overwritten { count } });
        }
    }
}

/// The entries of a reply.
#[derive(Clone, Copy)]
struct Batch<'a> {
    entries: &'a [Entry],
    model: Model,
}

#[expect(clippy::cast_possible_truncation, reason = "the low 16 bits are what is wanted")]
const fn low_16(value: u64) -> u16 {
    value as u16
}
