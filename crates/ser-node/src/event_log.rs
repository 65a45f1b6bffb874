//! The ring of the newest events.
//!
//! Internally every event has a sequence number that never repeats while the power is on. The
//! protocol's entry numbers, next slot and 16-bit total are derived from it. Appending overwrites
//! the oldest event once the ring is full.

use ser_proto::MAX_SIZE;

/// One event in the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Event {
    /// Milliseconds since 1970 by the recorder's clock, in 1970–2069.
    pub time_ms: i64,
    /// The inputs that changed, input 1 in bit 0.
    pub changed: u32,
    /// The inputs that are on after the change.
    pub state: u32,
}

impl Event {
    /// What unused storage holds.
    pub const EMPTY: Event = Event { time_ms: 0, changed: 0, state: 0 };
}

/// Ring of events over storage that the board provides.
#[derive(Debug)]
pub struct EventLog<'a> {
    storage: &'a mut [Event],
    /// Slots in use as the ring, at most the storage. Invariant: `len <= size`, `next_slot < size`
    /// (or both 0), and `next_slot == len` until the ring is full.
    size: usize,
    len: usize,
    next_slot: usize,
    /// Sequence number of the next event, and of the first one since the last erase.
    next_sequence: u64,
    erased_at: u64,
}

impl<'a> EventLog<'a> {
    /// An empty log that uses all of `storage`, up to 2048 entries.
    #[must_use]
    pub fn new(storage: &'a mut [Event]) -> EventLog<'a> {
        let size = storage.len().min(MAX_SIZE.into());
        EventLog { storage, size, len: 0, next_slot: 0, next_sequence: 0, erased_at: 0 }
    }

    /// The largest size that the storage allows.
    #[must_use]
    pub fn capacity(&self) -> u16 {
        narrow(self.storage.len().min(MAX_SIZE.into()))
    }

    /// Entries that the ring holds when it is full.
    #[must_use]
    pub fn size(&self) -> u16 {
        narrow(self.size)
    }

    /// Entries in use.
    #[must_use]
    pub fn len(&self) -> u16 {
        narrow(self.len)
    }

    /// Whether no entry is in use.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Events since the last erase or power-up, modulo 65536.
    #[must_use]
    pub fn total(&self) -> u16 {
        #[expect(clippy::cast_possible_truncation, reason = "the protocol's total wraps")]
        let total = self.events() as u16;
        total
    }

    /// Events since the last erase or power-up.
    #[must_use]
    pub const fn events(&self) -> u64 {
        self.next_sequence - self.erased_at
    }

    /// The slot that the next event will get; slot 0 is entry 1.
    #[must_use]
    pub fn next_slot(&self) -> u16 {
        narrow(self.next_slot)
    }

    /// Adds an event as the newest; returns its sequence number.
    pub fn append(&mut self, event: Event) -> u64 {
        if let Some(slot) = self.storage.get_mut(self.next_slot) {
            *slot = event;
            self.len = (self.len + 1).min(self.size);
            self.next_slot = if self.next_slot + 1 < self.size { self.next_slot + 1 } else { 0 };
        }
        self.next_sequence += 1;
        self.next_sequence - 1
    }

    /// Forgets all events. Total and next slot begin at zero again; sequence numbers continue.
    pub fn erase(&mut self) {
        self.len = 0;
        self.next_slot = 0;
        self.erased_at = self.next_sequence;
    }

    /// Changes the size (clamped to 1 … capacity). The newest events that fit are kept, in order,
    /// from slot 0. The total stays.
    pub fn resize(&mut self, size: u16) {
        let size = usize::from(size.min(self.capacity()).max(1)).min(self.storage.len());
        if size == self.size {
            return;
        }
        let kept = self.len.min(size);
        // In a ring that has wrapped, the events newer than the last slot continue in slot 0.
        let first =
            if self.len == self.size { self.next_slot + self.len - kept } else { self.len - kept };
        let first = if first < self.size { first } else { first - self.size };
        if let Some(ring) = self.storage.get_mut(..self.size) {
            move_to_front(ring, first);
        }
        self.size = size;
        self.len = kept;
        self.next_slot = if kept < size { kept } else { 0 };
    }

    /// Entry `number`, from 1, if it is in use.
    #[must_use]
    pub fn entry(&self, number: u16) -> Option<&Event> {
        let slot = usize::from(number).checked_sub(1)?;
        self.storage.get(..self.len)?.get(slot)
    }

    /// Sequence number of the oldest event that is still there; equal to
    /// [`next_sequence`](Self::next_sequence) when there is none.
    #[must_use]
    pub fn oldest_sequence(&self) -> u64 {
        self.next_sequence - self.len as u64
    }

    /// Sequence number that the next event will get.
    #[must_use]
    pub const fn next_sequence(&self) -> u64 {
        self.next_sequence
    }

    /// The entry number of the event with this sequence number, if it is still there.
    #[must_use]
    pub fn entry_number(&self, sequence: u64) -> Option<u16> {
        let back = usize::try_from(self.next_sequence.checked_sub(sequence)?).ok()?;
        if back == 0 || back > self.len {
            return None;
        }
        let slot = if back <= self.next_slot {
            self.next_slot - back
        } else {
            self.next_slot + self.size - back
        };
        Some(narrow(slot + 1))
    }
}

/// Rotates a ring so that slot `first` becomes slot 0. Reverses both parts and then the whole,
/// because the library's rotation has a path to a panic.
fn move_to_front(ring: &mut [Event], first: usize) {
    if let Some((before, from_first)) = ring.split_at_mut_checked(first) {
        before.reverse();
        from_first.reverse();
        ring.reverse();
    }
}

/// Sizes and slots are at most 2048.
fn narrow(value: usize) -> u16 {
    u16::try_from(value).unwrap_or(u16::MAX)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The log written without regard for memory: everything since the erase, minus what was cut
    /// off.
    #[derive(Default)]
    struct Reference {
        kept: Vec<Event>,
        size: usize,
        total: u64,
        /// Slot of the oldest kept event.
        first_slot: usize,
    }

    impl Reference {
        fn append(&mut self, event: Event) {
            self.kept.push(event);
            self.total += 1;
            if self.kept.len() > self.size {
                self.kept.remove(0);
                self.first_slot = (self.first_slot + 1) % self.size;
            }
        }

        fn resize(&mut self, size: usize) {
            if size != self.size {
                let cut = self.kept.len().saturating_sub(size);
                self.kept.drain(..cut);
                self.size = size;
                self.first_slot = 0;
            }
        }

        fn entry(&self, number: usize) -> Option<&Event> {
            let slot = number.checked_sub(1).filter(|&slot| slot < self.size)?;
            self.kept.get((slot + self.size - self.first_slot) % self.size)
        }
    }

    #[derive(Clone, Debug)]
    enum Operation {
        Append(usize),
        Erase,
        Resize(u16),
    }

    fn operation() -> impl Strategy<Value = Operation> {
        prop_oneof![
            4 => (1..40_usize).prop_map(Operation::Append),
            1 => Just(Operation::Erase),
            2 => (1..=24_u16).prop_map(Operation::Resize),
        ]
    }

    proptest! {
        #[test]
        fn the_log_equals_a_plain_list_over_random_operations(
            operations in prop::collection::vec(operation(), 0..60),
        ) {
            let mut storage = [Event::EMPTY; 24];
            let mut log = EventLog::new(&mut storage);
            let mut reference = Reference { size: 24, ..Reference::default() };
            let mut stamp = 0;
            for operation in operations {
                match operation {
                    Operation::Append(times) => for _ in 0..times {
                        stamp += 1;
                        let event = Event { time_ms: stamp, changed: 1, state: 2 };
                        log.append(event);
                        reference.append(event);
                    },
                    Operation::Erase => {
                        log.erase();
                        reference = Reference { size: reference.size, ..Reference::default() };
                    }
                    Operation::Resize(size) => {
                        log.resize(size);
                        reference.resize(size.into());
                    }
                }
                prop_assert_eq!(usize::from(log.len()), reference.kept.len());
                prop_assert_eq!(u64::from(log.total()), reference.total);
                let next = (reference.first_slot + reference.kept.len()) % reference.size;
                prop_assert_eq!(usize::from(log.next_slot()), next);
                for number in 0..=30_u16 {
                    prop_assert_eq!(log.entry(number), reference.entry(number.into()));
                }
                let by_sequence: Vec<_> = (log.oldest_sequence()..log.next_sequence())
                    .map(|sequence| *log.entry(log.entry_number(sequence).unwrap()).unwrap())
                    .collect();
                prop_assert_eq!(&by_sequence, &reference.kept);
                prop_assert_eq!(log.entry_number(log.next_sequence()), None);
                prop_assert_eq!(log.oldest_sequence().checked_sub(1).and_then(|s| log.entry_number(s)), None);
            }
        }
    }

    #[test]
    fn the_total_wraps_at_16_bits_and_goes_on() {
        let mut storage = [Event::EMPTY; 4];
        let mut log = EventLog::new(&mut storage);
        for _ in 0..65_537 {
            log.append(Event::EMPTY);
        }
        assert_eq!((log.total(), log.next_slot(), log.len()), (1, 1, 4));
    }

    #[test]
    fn sizes_are_clamped_to_the_storage() {
        let mut storage = [Event::EMPTY; 4];
        let mut log = EventLog::new(&mut storage);
        log.resize(2048);
        assert_eq!(log.size(), 4);
        log.resize(0);
        assert_eq!(log.size(), 1);
    }

    #[test]
    fn a_log_without_storage_records_nothing_and_says_so() {
        let mut log = EventLog::new(&mut []);
        log.append(Event::EMPTY);
        log.resize(5);
        assert_eq!((log.total(), log.len(), log.size(), log.entry(1)), (1, 0, 0, None));
    }
}
