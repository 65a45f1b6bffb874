//! A recorder's log in its plainest form, to compare the real reading against.
#![allow(dead_code, reason = "every test file uses a part of it")]

pub(crate) mod unit;

use ser_client::{Delivery, Lost};
use ser_proto::{Entry, Inputs, MAX_ENTRIES, Model, ReadReply, TimeStamp};

/// The log, and everything that ever happened to it.
#[derive(Clone, Debug)]
pub(crate) struct Recorder {
    pub(crate) model: Model,
    pub(crate) size: usize,
    /// Ring slots in physical order; shorter than `size` until the ring is full.
    slots: Vec<Entry>,
    next_slot: usize,
    /// All events in the present life of the log, since it was erased.
    pub(crate) history: Vec<Entry>,
    /// The start of the total, to reach its wrap quickly.
    offset: u64,
    /// Makes every event different from all others.
    serial: u32,
    /// The most entries that one reply takes.
    pub(crate) reply_limit: usize,
}

impl Recorder {
    pub(crate) fn new(size: usize) -> Recorder {
        Recorder {
            model: Model::Ser320,
            size,
            slots: Vec::new(),
            next_slot: 0,
            history: Vec::new(),
            offset: 0,
            serial: 0,
            reply_limit: MAX_ENTRIES,
        }
    }

    /// A recorder that has counted `events` events.
    pub(crate) fn after(size: usize, events: u64) -> Recorder {
        let mut recorder = Recorder::new(size);
        let kept = u64::try_from(size).unwrap() * 3;
        if events > kept {
            // Events that can no longer be read need not be remembered; only their number matters.
            recorder.offset = events - kept;
            recorder.next_slot = usize::try_from(recorder.offset).unwrap() % size;
            recorder.slots = vec![event(0); size];
        }
        for _ in 0..events.min(kept) {
            recorder.append();
        }
        recorder
    }

    pub(crate) fn append(&mut self) {
        self.serial += 1;
        let entry = event(self.serial);
        match self.slots.get_mut(self.next_slot) {
            Some(slot) => *slot = entry,
            None => self.slots.push(entry),
        }
        self.next_slot = (self.next_slot + 1) % self.size;
        self.history.push(entry);
    }

    /// Makes changes that are not recorded, and returns the state after them.
    pub(crate) fn skip(&mut self, changes: u32) -> u32 {
        self.serial += changes;
        event(self.serial).state.0
    }

    pub(crate) fn append_many(&mut self, count: usize) {
        for _ in 0..count {
            self.append();
        }
    }

    /// An erase or a loss of power; a host sees no difference.
    pub(crate) fn erase(&mut self) {
        self.slots.clear();
        self.history.clear();
        self.next_slot = 0;
        self.offset = 0;
    }

    pub(crate) fn resize(&mut self, size: usize) {
        let held = self.slots.len();
        let oldest = if held == self.size { self.next_slot } else { 0 };
        let in_order = (0..held).map(|age| self.slots[(oldest + age) % held]);
        self.slots = in_order.skip(held.saturating_sub(size)).collect();
        self.size = size;
        self.next_slot = self.slots.len() % size;
    }

    pub(crate) fn held(&self) -> usize {
        self.slots.len()
    }

    /// The serial number of the very first event, if the list reaches back to it.
    pub(crate) fn first_serial_known(&self) -> Option<u32> {
        (self.offset == 0).then_some(1)
    }

    /// The sequence of an event of the present life, if the list reaches back to it.
    pub(crate) fn sequence(&self, serial_number: u32) -> Option<u64> {
        let index = self.history.binary_search_by_key(&serial_number, serial).ok()?;
        Some(self.offset + u64::try_from(index).unwrap() + 1)
    }

    /// Events since the erase, without wrapping.
    pub(crate) fn count(&self) -> u64 {
        self.offset + u64::try_from(self.history.len()).unwrap()
    }

    pub(crate) fn total(&self) -> u16 {
        u16::try_from(self.count() % 65_536).unwrap()
    }

    pub(crate) fn read(&self, start: u16, count: u8) -> ReadReply {
        let first = usize::from(start).checked_sub(1).unwrap_or(usize::MAX);
        let count = usize::from(count).min(self.reply_limit);
        let entries: heapless::Vec<Entry, MAX_ENTRIES> =
            self.slots.iter().skip(first).take(count).copied().collect();
        ReadReply {
            start,
            total: self.total(),
            next_slot: u16::try_from(self.next_slot).unwrap(),
            model: (!entries.is_empty()).then_some(self.model),
            entries,
        }
    }
}

/// Event number `serial`, different from every other one. The state is its Gray code, so one input
/// changes from each event to the next.
pub(crate) fn event(serial: u32) -> Entry {
    let time =
        TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };
    let changed = gray(serial) ^ gray(serial.wrapping_sub(1));
    Entry { changed: Inputs(changed), state: Inputs(gray(serial)), time }
}

/// The serial number of an event made by [`event`].
pub(crate) fn serial(entry: &Entry) -> u32 {
    let mut serial = entry.state.0;
    for shift in [1, 2, 4, 8, 16] {
        serial ^= serial >> shift;
    }
    assert_eq!(*entry, event(serial));
    serial
}

const fn gray(serial: u32) -> u32 {
    serial ^ serial >> 1
}

/// A delivery in a form for comparing and printing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Told {
    Event(u32),
    Overwritten(u32),
    AtLeast(u32),
    Restarted,
    Unrecorded(u32),
}

pub(crate) fn told(delivery: Delivery) -> Told {
    match delivery {
        Delivery::Event { entry, .. } => Told::Event(serial(&entry)),
        Delivery::Lost { lost, .. } => match lost {
            Lost::Overwritten { count } => Told::Overwritten(count),
            Lost::OverwrittenAtLeast { count } => Told::AtLeast(count),
            Lost::LogRestarted => Told::Restarted,
            Lost::Unrecorded { inputs } => Told::Unrecorded(inputs.0),
        },
    }
}
