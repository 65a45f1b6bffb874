//! The configuration in non-volatile memory: two checked copies, of which at least one is always
//! intact.
//!
//! ```text
//! | 'S' | format | sequence (4) | configuration (6) | CRC-32 (4) |    16 bytes, numbers little-endian
//! ```
//!
//! Saving writes the older copy and leaves the newer one alone. A power cut during a write
//! therefore costs the new configuration at most, never both. The configuration is stored in the
//! form of a `C` reply.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use ser_proto::{Code, Configuration, Reply};

/// Bytes of one stored copy.
pub const RECORD_LEN: usize = 16;

const MAGIC: u8 = b'S';
const FORMAT: u8 = 1;
const CHECKED_LEN: usize = RECORD_LEN - 4;

/// Without a table: a few hundred cycles on a rare occasion cost less than a kilobyte of flash.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

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

/// The configuration could not be stored. It is in force until the power goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotStored;

/// Loads and saves the configuration.
pub(crate) struct Settings<S> {
    storage: S,
    /// The copy that holds the newest record, its sequence number and its content.
    newest: Option<(CopyNumber, u32, Configuration)>,
}

impl<S: Storage> Settings<S> {
    /// Reads both copies; returns the newest intact one, or the default configuration.
    pub(crate) fn load(mut storage: S) -> (Settings<S>, Configuration) {
        let first = read(&mut storage, CopyNumber::First);
        let second = read(&mut storage, CopyNumber::Second);
        let newest = match (first, second) {
            // The second copy is newer when it is ahead by less than half of the range, because
            // sequence numbers may wrap.
            (Some((older, _)), Some((newer, configuration)))
                if newer.wrapping_sub(older) <= u32::MAX / 2 =>
            {
                Some((CopyNumber::Second, newer, configuration))
            }
            (Some((sequence, configuration)), _) => {
                Some((CopyNumber::First, sequence, configuration))
            }
            (None, Some((sequence, configuration))) => {
                Some((CopyNumber::Second, sequence, configuration))
            }
            (None, None) => None,
        };
        let configuration =
            newest.map_or_else(Configuration::default, |(_, _, configuration)| configuration);
        (Settings { storage, newest }, configuration)
    }

    /// Whether this is the configuration that the next power-up will find.
    pub(crate) fn holds(&self, configuration: &Configuration) -> bool {
        self.newest.is_some_and(|(_, _, stored)| stored == *configuration)
    }

    /// Stores the configuration over the older copy and reads it back.
    pub(crate) fn save(&mut self, configuration: &Configuration) -> Result<(), NotStored> {
        let (copy, sequence) = match self.newest {
            Some((CopyNumber::First, sequence, _)) => {
                (CopyNumber::Second, sequence.wrapping_add(1))
            }
            Some((CopyNumber::Second, sequence, _)) => {
                (CopyNumber::First, sequence.wrapping_add(1))
            }
            None => (CopyNumber::First, 0),
        };
        self.storage.write(copy, &encode(sequence, configuration)).map_err(|_| NotStored)?;
        match read(&mut self.storage, copy) {
            Some(stored) if stored == (sequence, *configuration) => {
                self.newest = Some((copy, sequence, *configuration));
                Ok(())
            }
            _ => Err(NotStored),
        }
    }
}

fn encode(sequence: u32, configuration: &Configuration) -> [u8; RECORD_LEN] {
    let mut record = [0; RECORD_LEN];
    let body = Reply::Configuration(*configuration).to_body();
    let params = body.iter().skip(1).copied();
    let content = [MAGIC, FORMAT].into_iter().chain(sequence.to_le_bytes()).chain(params);
    for (place, byte) in record.iter_mut().zip(content) {
        *place = byte;
    }
    if let Some((checked, crc)) = record.split_at_mut_checked(CHECKED_LEN) {
        crc.copy_from_slice(&CRC.checksum(checked).to_le_bytes());
    }
    record
}

fn read<S: Storage>(storage: &mut S, copy: CopyNumber) -> Option<(u32, Configuration)> {
    let mut record = [0; RECORD_LEN];
    storage.read(copy, &mut record).ok()?;
    decode(&record)
}

fn decode(record: &[u8; RECORD_LEN]) -> Option<(u32, Configuration)> {
    let (checked, crc) = record.split_last_chunk::<4>()?;
    if CRC.checksum(checked) != u32::from_le_bytes(*crc) {
        return None;
    }
    let [MAGIC, FORMAT, content @ ..] = checked else { return None };
    let (sequence, params) = content.split_first_chunk::<4>()?;
    let mut body = [Code::Configure.byte(); Configuration::BODY_LEN];
    body.get_mut(1..)?.copy_from_slice(params);
    match Reply::parse(&body) {
        Ok(Reply::Configuration(configuration)) => {
            Some((u32::from_le_bytes(*sequence), configuration))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use proptest::prelude::*;
    use ser_proto::{AutoReport, Baud};

    use super::*;

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

    fn configuration(size: u16) -> Configuration {
        Configuration {
            size,
            baud: Baud::B19200,
            auto_report: AutoReport::Rs232,
            report_address: 31,
            auto_print: true,
        }
    }

    #[test]
    fn memory_that_was_never_written_gives_the_defaults() {
        for blank in [0x00, 0xFF] {
            let (_, loaded) = Settings::load(Memory::new(blank));
            assert_eq!(loaded, Configuration::default());
        }
    }

    #[test]
    fn the_newest_of_many_configurations_survives() {
        let memory = Memory::new(0xFF);
        for size in 1..=9 {
            let (mut settings, _) = Settings::load(memory.clone());
            assert_eq!(settings.save(&configuration(size)), Ok(()));
            assert_eq!(Settings::load(memory.clone()).1, configuration(size));
        }
    }

    #[test]
    fn sequence_numbers_may_wrap() {
        let memory = Memory::new(0xFF);
        *memory.copies.borrow_mut() =
            [encode(u32::MAX - 1, &configuration(1)), encode(u32::MAX, &configuration(2))];
        let (mut settings, loaded) = Settings::load(memory.clone());
        assert_eq!(loaded.size, 2);
        assert_eq!(settings.save(&configuration(3)), Ok(()));
        assert_eq!(Settings::load(memory).1.size, 3);
    }

    #[test]
    fn a_power_cut_at_any_byte_leaves_the_old_or_the_new_configuration() {
        for saves_before in 0..4 {
            for cut_after in 0..=RECORD_LEN {
                let memory = Memory::new(0xFF);
                let (mut settings, mut before) = Settings::load(memory.clone());
                for size in 1..=saves_before {
                    before = configuration(size);
                    assert_eq!(settings.save(&before), Ok(()));
                }
                *memory.bytes_until_power_cut.borrow_mut() = cut_after;
                let _ = settings.save(&configuration(100));
                *memory.bytes_until_power_cut.borrow_mut() = usize::MAX;
                let (_, after) = Settings::load(memory);
                let expected = if cut_after < RECORD_LEN { before } else { configuration(100) };
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
        let (mut settings, _) = Settings::load(Worn);
        assert_eq!(settings.save(&configuration(5)), Err(NotStored));
    }

    proptest! {
        #[test]
        fn a_record_with_any_flipped_bit_is_refused(bit in 0..RECORD_LEN * 8, size in 1..=2048_u16) {
            let mut record = encode(7, &configuration(size));
            prop_assert_eq!(decode(&record), Some((7, configuration(size))));
            record[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(decode(&record), None);
        }
    }
}
