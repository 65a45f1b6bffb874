//! A recorder whose events can be distinguished, because each carries its running number.

use ser_proto::{Command, Entry, Inputs, Model, ReadReply, Reply, TimeStamp};

/// A log that remembers everything.
pub(super) struct TruthfulUnit {
    /// Running numbers of the events in their slots.
    slots: Vec<u32>,
    size: u16,
    /// The smallest size that it has had.
    smallest: u16,
    next_slot: usize,
    total: u16,
    happened: u32,
    /// Running numbers of the first events after each erase.
    erased_before: Vec<u32>,
}

impl TruthfulUnit {
    /// A recorder with a log of `size` entries that has already counted to `total`.
    pub(super) fn new(size: u16, total: u16) -> TruthfulUnit {
        let mut unit = TruthfulUnit {
            slots: Vec::new(),
            size,
            smallest: size,
            next_slot: 0,
            total: 0,
            happened: 0,
            erased_before: vec![0],
        };
        unit.record(total.into());
        unit
    }

    pub(super) fn happened(&self) -> u32 {
        self.happened
    }

    /// Where the log that contains this event began: the running number of the first event after an
    /// erase.
    pub(super) fn log_began(&self, number: u32) -> u32 {
        self.erased_before.iter().rev().copied().find(|&began| began <= number).unwrap_or(0)
    }

    /// Whether the log that began with this event may have been full.
    pub(super) fn was_full(&self, began: u32) -> bool {
        let end = self
            .erased_before
            .iter()
            .copied()
            .find(|&other| other > began)
            .unwrap_or(self.happened);
        end - began >= self.smallest.into()
    }

    /// Records `count` events.
    pub(super) fn record(&mut self, count: u32) {
        for _ in 0..count {
            let number = self.happened;
            match self.slots.get_mut(self.next_slot) {
                Some(slot) => *slot = number,
                None => self.slots.push(number),
            }
            self.next_slot = (self.next_slot + 1) % usize::from(self.size);
            self.total = self.total.wrapping_add(1);
            self.happened += 1;
        }
    }

    pub(super) fn erase(&mut self) {
        self.slots.clear();
        (self.next_slot, self.total) = (0, 0);
        self.erased_before.push(self.happened);
    }

    /// Gives the ring another size. The newest events stay, from the first slot on.
    pub(super) fn resize(&mut self, size: u16) {
        if self.slots.len() == usize::from(self.size) {
            self.slots.rotate_left(self.next_slot);
        }
        self.slots.drain(..self.slots.len().saturating_sub(size.into()));
        self.size = size;
        self.smallest = self.smallest.min(size);
        self.next_slot = self.slots.len() % usize::from(size);
    }

    pub(super) fn size(&self) -> u16 {
        self.size
    }

    pub(super) fn answer(&self, command: &Command) -> Reply {
        match *command {
            Command::Read { start, count } => Reply::Read(self.read(start, count)),
            ref other => panic!("nobody asks {other:?} here"),
        }
    }

    pub(super) fn read(&self, start: u16, count: u8) -> ReadReply {
        let slot = usize::from(start).wrapping_sub(1);
        let existing = self.slots.get(slot..).unwrap_or_default();
        let entries: Vec<u32> = existing.iter().copied().take(usize::from(count).min(10)).collect();
        ReadReply {
            start,
            total: self.total,
            next_slot: u16::try_from(self.next_slot).expect("below the size"),
            model: (!entries.is_empty()).then_some(Model::Ser320),
            entries: entries.into_iter().map(entry).collect(),
        }
    }

    /// An auto report of the newest events, up to the end of the ring.
    pub(super) fn report(&self, count: u8) -> Option<ReadReply> {
        let newest = self.next_slot.checked_sub(1).unwrap_or(usize::from(self.size) - 1);
        let first = newest.saturating_sub(usize::from(count % 10));
        let count = u8::try_from(newest - first + 1).expect("at most ten");
        (newest < self.slots.len())
            .then(|| self.read(u16::try_from(first + 1).expect("an entry"), count))
    }
}

/// The event with this running number. What changed and the state before fit together.
fn entry(number: u32) -> Entry {
    let time =
        TimeStamp { year: 26, month: 1, day: 1, hour: 0, minute: 0, second: 0, millisecond: 0 };
    Entry { changed: Inputs(number ^ number.wrapping_sub(1)), state: Inputs(number), time }
}

/// The running number of an event.
pub(super) fn number_of(event: &Entry) -> u32 {
    assert_eq!(*event, entry(event.state.0), "an event that never was");
    event.state.0
}
