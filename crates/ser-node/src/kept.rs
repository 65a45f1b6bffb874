//! What a recorder keeps without power, as a record of fixed length.
//!
//! ```text
//! | 'S' | 2 | sequence (4) | configuration (6) | power-ups (4) | lives (4) | has filters |
//!       | filters (32 × 6) | unused, 0 (39) | CRC-32 (4) |    256 bytes, numbers little-endian
//! | 'S' | 1 | sequence (4) | configuration (6) | CRC-32 (4) |    16 bytes, read only
//! ```
//! Configuration and filters are stored as `C` and `F` send them. The short form comes from before
//! there was more to keep; what it does not say is as in a new recorder.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use ser_proto::{Code, Configuration, InputFilter, Reply};

/// Bytes of a stored record.
pub const RECORD_LEN: usize = 256;

/// Bytes of a record of the first format.
const OLD_LEN: usize = 16;

const MAGIC: u8 = b'S';
const FORMAT: u8 = 2;
const OLD_FORMAT: u8 = 1;

const CRC_LEN: usize = 4;
const CONFIGURATION_LEN: usize = Configuration::BODY_LEN - 1;

/// Inputs that have filters, on recorders of either model.
pub(crate) const FILTERS: usize = 32;

/// Without a table: a few thousand cycles on a rare occasion cost less than a kilobyte of flash.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What a recorder keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Kept {
    pub(crate) configuration: Configuration,
    /// By input, input 1 first; `None` until a host has set one.
    pub(crate) filters: Option<[InputFilter; FILTERS]>,
    /// Power-ups so far.
    pub(crate) power_ups: u32,
    /// Lives of the log so far: each power-up and each erase begins one.
    pub(crate) lives: u32,
}

impl Kept {
    /// What a new recorder holds.
    pub(crate) fn new() -> Kept {
        Kept { configuration: Configuration::default(), filters: None, power_ups: 0, lives: 0 }
    }

    /// Writes it as the record with this sequence number.
    pub(crate) fn encode(&self, sequence: u32, record: &mut [u8; RECORD_LEN]) {
        record.fill(0);
        for (place, byte) in record.iter_mut().zip(self.content(sequence)) {
            *place = byte;
        }
        if let Some((checked, crc)) = record.split_last_chunk_mut::<CRC_LEN>() {
            *crc = CRC.checksum(checked).to_le_bytes();
        }
    }

    fn content(&self, sequence: u32) -> impl Iterator<Item = u8> {
        let configuration = Reply::Configuration(self.configuration).to_body();
        let params = (1..Configuration::BODY_LEN)
            .map(move |place| configuration.get(place).copied().unwrap_or_default());
        [MAGIC, FORMAT]
            .into_iter()
            .chain(sequence.to_le_bytes())
            .chain(params)
            .chain(self.power_ups.to_le_bytes())
            .chain(self.lives.to_le_bytes())
            .chain([u8::from(self.filters.is_some())])
            .chain(self.filters.iter().flatten().flat_map(|filter| filter.to_bytes()))
    }

    /// Takes what a record holds, and returns its sequence number; `None` if it is not intact, and
    /// then nothing is taken.
    pub(crate) fn take_from(&mut self, record: &[u8; RECORD_LEN]) -> Option<u32> {
        let (content, has_more) = content(record)?;
        let (sequence, configuration, rest) = begin(content)?;
        self.configuration = configuration;
        (self.filters, self.power_ups, self.lives) = (None, 0, 0);
        if has_more
            && let Some((power_ups, rest)) = rest.split_first_chunk()
            && let Some((lives, rest)) = rest.split_first_chunk()
            && let Some((&has_filters, stored)) = rest.split_first()
        {
            self.power_ups = u32::from_le_bytes(*power_ups);
            self.lives = u32::from_le_bytes(*lives);
            if has_filters != 0 {
                self.filters = Some(filters(stored));
            }
        }
        Some(sequence)
    }

    /// The sequence number of a record, if it holds exactly this.
    pub(crate) fn sequence_in(&self, record: &[u8; RECORD_LEN]) -> Option<u32> {
        let sequence = sequence(record)?;
        let unused = core::iter::repeat(0);
        let expected = self.content(sequence).chain(unused);
        let content = record.split_last_chunk::<CRC_LEN>()?.0.iter().copied();
        content.zip(expected).all(|(found, expected)| found == expected).then_some(sequence)
    }
}

/// The sequence number of a record, if it is intact.
pub(crate) fn sequence(record: &[u8; RECORD_LEN]) -> Option<u32> {
    let (content, _) = content(record)?;
    begin(content).map(|(sequence, ..)| sequence)
}

/// What a record holds before its check, if that is right, and whether it is more than a
/// configuration.
fn content(record: &[u8; RECORD_LEN]) -> Option<(&[u8], bool)> {
    match record {
        [MAGIC, FORMAT, ..] => Some((checked(record)?, true)),
        [MAGIC, OLD_FORMAT, ..] => Some((checked(record.get(..OLD_LEN)?)?, false)),
        _ => None,
    }
}

fn filters(stored: &[u8]) -> [InputFilter; FILTERS] {
    let mut filters = [InputFilter::OFF; FILTERS];
    for (filter, stored) in filters.iter_mut().zip(stored.as_chunks::<{ InputFilter::LEN }>().0) {
        *filter = InputFilter::from_bytes(*stored);
    }
    filters
}

/// The content of a record whose check is right.
fn checked(record: &[u8]) -> Option<&[u8]> {
    let (content, crc) = record.split_last_chunk::<CRC_LEN>()?;
    (CRC.checksum(content) == u32::from_le_bytes(*crc)).then_some(content)
}

/// What all formats begin with, and what comes behind it.
fn begin(content: &[u8]) -> Option<(u32, Configuration, &[u8])> {
    let (sequence, rest) = content.get(2..)?.split_first_chunk::<4>()?;
    let (params, rest) = rest.split_first_chunk::<CONFIGURATION_LEN>()?;
    let mut body = [Code::Configure.byte(); Configuration::BODY_LEN];
    body.get_mut(1..)?.copy_from_slice(params);
    match Reply::parse(&body) {
        Ok(Reply::Configuration(configuration)) => {
            Some((u32::from_le_bytes(*sequence), configuration, rest))
        }
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;
    use ser_proto::{AutoReport, Baud};

    use super::*;

    /// The n-th of many, each unlike the others.
    pub(crate) fn kept(number: u16) -> Kept {
        let configuration = Configuration {
            size: number,
            baud: Baud::B19200,
            auto_report: AutoReport::Rs232,
            report_address: 31,
            auto_print: true,
        };
        let mut filters = [InputFilter::OFF; FILTERS];
        filters[31] = InputFilter::from_bytes([9, 5, 0, 100, 1, 0]);
        filters[usize::from(number % 31)].debounce_ms = 3;
        let filters = (!number.is_multiple_of(4)).then_some(filters);
        Kept { configuration, filters, power_ups: number.into(), lives: 7 }
    }

    /// A record as it was before there was more to keep than the configuration.
    pub(crate) fn old_record(sequence: u8, size: u8) -> [u8; RECORD_LEN] {
        let mut record = [0xFF; RECORD_LEN];
        record[..12].copy_from_slice(&[b'S', 1, sequence, 0, 0, 0, 0, size, 7, 1, 31, 1]);
        let crc = CRC.checksum(&record[..12]).to_le_bytes();
        record[12..16].copy_from_slice(&crc);
        record
    }

    fn encoded(sequence: u32, kept: &Kept) -> [u8; RECORD_LEN] {
        let mut record = [0xA5; RECORD_LEN];
        kept.encode(sequence, &mut record);
        record
    }

    #[test]
    fn a_record_of_the_first_format_is_read() {
        let mut found = kept(3);
        assert_eq!(found.take_from(&old_record(9, 200)), Some(9));
        assert_eq!(found.configuration.size, 200);
        assert_eq!(Kept { configuration: Configuration::default(), ..found }, Kept::new());
        let mut damaged = old_record(9, 200);
        damaged[7] ^= 1;
        let mut untouched = kept(3);
        assert_eq!((untouched.take_from(&damaged), untouched), (None, kept(3)));
    }

    proptest! {
        #[test]
        fn a_record_with_any_flipped_bit_is_refused(bit in 0..RECORD_LEN * 8, number in 1..=2048_u16) {
            let mut record = encoded(7, &kept(number));
            let mut found = Kept::new();
            prop_assert_eq!((found.take_from(&record), found), (Some(7), kept(number)));
            prop_assert_eq!(kept(number).sequence_in(&record), Some(7));
            prop_assert_eq!(kept(number + 1).sequence_in(&record), None);
            record[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(Kept::new().take_from(&record), None);
            prop_assert_eq!(kept(number).sequence_in(&record), None);
        }
    }
}
