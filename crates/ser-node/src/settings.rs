//! Non-volatile memory: two checked copies of what the recorder keeps, of which at least one is
//! always intact.
//!
//! Saving writes the older copy and leaves the newer one alone. A power cut during a write
//! therefore costs what is new at most, never both.

use crate::kept::{self, Kept, RECORD_LEN};

/// One of the two places for a copy. They must not share an erase unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CopyNumber {
    /// The first place.
    First,
    /// The second place.
    Second,
}

/// Non-volatile memory with two places of [`RECORD_LEN`] bytes.
pub trait Storage {
    /// What can go wrong.
    type Error;

    /// Reads a copy; memory that was never written may hold anything.
    ///
    /// # Errors
    /// When the memory cannot be read.
    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), Self::Error>;

    /// Writes a copy. The other copy must stay as it was, even if the power fails during the write.
    ///
    /// # Errors
    /// When the memory cannot be written.
    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), Self::Error>;
}

/// It could not be stored. It is in force until the power goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotStored;

/// Loads and saves what the recorder keeps.
pub(crate) struct Settings<'a, S> {
    storage: S,
    /// The copy that holds the newest record, and its sequence number.
    newest: Option<(CopyNumber, u32)>,
    /// A record on its way.
    record: &'a mut [u8; RECORD_LEN],
}

impl<'a, S: Storage> Settings<'a, S> {
    /// Reads both copies; returns what the newest intact one holds, or what a new recorder does.
    pub(crate) fn load(storage: S, record: &'a mut [u8; RECORD_LEN]) -> (Settings<'a, S>, Kept) {
        let mut settings = Settings { storage, newest: None, record };
        let first = settings.read(CopyNumber::First).and_then(kept::sequence);
        let second = settings.read(CopyNumber::Second).and_then(kept::sequence);
        settings.newest = match (first, second) {
            // The second copy is newer when it is ahead by less than half of the range, because
            // sequence numbers may wrap.
            (Some(older), Some(newer)) if newer.wrapping_sub(older) <= u32::MAX / 2 => {
                Some((CopyNumber::Second, newer))
            }
            (Some(sequence), _) => Some((CopyNumber::First, sequence)),
            (None, Some(sequence)) => Some((CopyNumber::Second, sequence)),
            (None, None) => None,
        };
        let mut kept = Kept::new();
        if let Some((copy, _)) = settings.newest
            && let Some(record) = settings.read(copy)
        {
            kept.take_from(record);
        }
        (settings, kept)
    }

    /// Whether the next power-up will find this.
    pub(crate) fn holds(&mut self, kept: &Kept) -> bool {
        let Some((copy, sequence)) = self.newest else { return false };
        self.read(copy).and_then(|record| kept.sequence_in(record)) == Some(sequence)
    }

    /// Stores it over the older copy and reads it back.
    pub(crate) fn save(&mut self, kept: &Kept) -> Result<(), NotStored> {
        let (copy, sequence) = match self.newest {
            Some((CopyNumber::First, sequence)) => (CopyNumber::Second, sequence.wrapping_add(1)),
            Some((CopyNumber::Second, sequence)) => (CopyNumber::First, sequence.wrapping_add(1)),
            None => (CopyNumber::First, 0),
        };
        kept.encode(sequence, self.record);
        self.storage.write(copy, self.record).map_err(|_| NotStored)?;
        if self.read(copy).and_then(|record| kept.sequence_in(record)) != Some(sequence) {
            return Err(NotStored);
        }
        self.newest = Some((copy, sequence));
        Ok(())
    }

    fn read(&mut self, copy: CopyNumber) -> Option<&[u8; RECORD_LEN]> {
        self.storage.read(copy, self.record).ok()?;
        Some(self.record)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use super::*;
    use crate::kept::tests::{kept, old_record};

    /// Memory that outlives the recorder. Its power can be cut after a given number of bytes
    /// written.
    #[derive(Clone)]
    struct Memory {
        copies: Rc<RefCell<[[u8; RECORD_LEN]; 2]>>,
        bytes_until_power_cut: Rc<RefCell<usize>>,
    }

    struct PowerCut;

    impl Memory {
        fn new(blank: u8) -> Memory {
            Memory {
                copies: Rc::new(RefCell::new([[blank; RECORD_LEN]; 2])),
                bytes_until_power_cut: Rc::new(RefCell::new(usize::MAX)),
            }
        }
    }

    impl Storage for Memory {
        type Error = PowerCut;

        fn read(
            &mut self,
            copy: CopyNumber,
            record: &mut [u8; RECORD_LEN],
        ) -> Result<(), PowerCut> {
            if *self.bytes_until_power_cut.borrow() == 0 {
                return Err(PowerCut);
            }
            *record = self.copies.borrow()[copy as usize];
            Ok(())
        }

        fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), PowerCut> {
            for (index, &byte) in record.iter().enumerate() {
                let mut left = self.bytes_until_power_cut.borrow_mut();
                if *left == 0 {
                    // The byte being written is neither the old one nor the new one.
                    self.copies.borrow_mut()[copy as usize][index] ^= 0xA5;
                    return Err(PowerCut);
                }
                *left -= 1;
                self.copies.borrow_mut()[copy as usize][index] = byte;
            }
            Ok(())
        }
    }

    #[test]
    fn memory_that_was_never_written_gives_the_defaults() {
        for blank in [0x00, 0xFF] {
            let (_, loaded) = Settings::load(Memory::new(blank), &mut [0; RECORD_LEN]);
            assert_eq!(loaded, Kept::new());
        }
    }

    #[test]
    fn the_newest_of_many_configurations_survives() {
        let memory = Memory::new(0xFF);
        for size in 1..=9 {
            let mut record = [0; RECORD_LEN];
            let (mut settings, _) = Settings::load(memory.clone(), &mut record);
            assert_eq!(settings.save(&kept(size)), Ok(()));
            assert!(settings.holds(&kept(size)) && !settings.holds(&kept(100)));
            assert_eq!(Settings::load(memory.clone(), &mut [0; RECORD_LEN]).1, kept(size));
        }
    }

    #[test]
    fn sequence_numbers_may_wrap() {
        let memory = Memory::new(0xFF);
        kept(1).encode(u32::MAX - 1, &mut memory.copies.borrow_mut()[0]);
        kept(2).encode(u32::MAX, &mut memory.copies.borrow_mut()[1]);
        let mut record = [0; RECORD_LEN];
        let (mut settings, loaded) = Settings::load(memory.clone(), &mut record);
        assert_eq!(loaded, kept(2));
        assert_eq!(settings.save(&kept(3)), Ok(()));
        assert_eq!(Settings::load(memory, &mut [0; RECORD_LEN]).1, kept(3));
    }

    #[test]
    fn what_an_earlier_firmware_stored_is_kept_until_something_newer_is() {
        let memory = Memory::new(0xFF);
        *memory.copies.borrow_mut() = [old_record(5, 50), old_record(4, 40)];
        let mut record = [0; RECORD_LEN];
        let (mut settings, loaded) = Settings::load(memory.clone(), &mut record);
        assert_eq!(loaded.configuration.size, 50);
        assert_eq!(settings.save(&kept(3)), Ok(()));
        assert_eq!(Settings::load(memory.clone(), &mut [0; RECORD_LEN]).1, kept(3));
        assert_eq!(memory.copies.borrow()[0], old_record(5, 50), "the newest of the old ones");
    }

    #[test]
    fn a_power_cut_at_any_byte_leaves_the_old_or_the_new_configuration() {
        for saves_before in 0..4 {
            for cut_after in 0..=RECORD_LEN {
                let memory = Memory::new(0xFF);
                let mut record = [0; RECORD_LEN];
                let (mut settings, mut before) = Settings::load(memory.clone(), &mut record);
                for size in 1..=saves_before {
                    before = kept(size);
                    assert_eq!(settings.save(&before), Ok(()));
                }
                *memory.bytes_until_power_cut.borrow_mut() = cut_after;
                let _ = settings.save(&kept(100));
                *memory.bytes_until_power_cut.borrow_mut() = usize::MAX;
                let (_, after) = Settings::load(memory, &mut [0; RECORD_LEN]);
                let expected = if cut_after < RECORD_LEN { before } else { kept(100) };
                assert_eq!(after, expected, "cut after {cut_after} bytes");
            }
        }
    }

    #[test]
    fn memory_that_does_not_keep_what_is_written_is_noticed() {
        struct Worn;
        impl Storage for Worn {
            type Error = PowerCut;
            fn read(
                &mut self,
                _: CopyNumber,
                record: &mut [u8; RECORD_LEN],
            ) -> Result<(), PowerCut> {
                record.fill(0xFF);
                Ok(())
            }
            fn write(&mut self, _: CopyNumber, _: &[u8; RECORD_LEN]) -> Result<(), PowerCut> {
                Ok(())
            }
        }
        let mut record = [0; RECORD_LEN];
        let (mut settings, _) = Settings::load(Worn, &mut record);
        assert_eq!(settings.save(&kept(5)), Err(NotStored));
    }
}
