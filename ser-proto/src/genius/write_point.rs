//! Write Point, subfunction 0Bh: sets and clears single bits in two bytes of a host's memory.
//!
//! ```text
//! | length 4 | address (3, low first) | AND | OR | AND | OR |    8 bytes
//! ```
//!
//! The first fields are those of the other memory accesses. The masks are in the order of the PLC
//! command that makes such datagrams. `docs/genius.md` says how sure this is.

use nom::Parser;
use nom::number::complete::be_u8;

use super::message_error::parse_data;
use super::{Data, MemoryAddress, MessageError, Subfunction};
use crate::fields::byte;

/// Bytes after the address.
const MASKS_LEN: u8 = 4;

/// Length, address and masks.
const LEN: usize = 8;

/// Which bits of a byte change: a bit outside `and` is cleared, a bit in `or` is set, and the
/// others stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PointMask {
    /// The bits that are not cleared.
    pub and: u8,
    /// The bits that are set.
    pub or: u8,
}

impl PointMask {
    /// Leaves a byte unchanged.
    pub const KEEP: PointMask = PointMask { and: 0xFF, or: 0 };

    /// The byte after the change.
    #[must_use]
    pub const fn apply(self, byte: u8) -> u8 {
        byte & self.and | self.or
    }
}

/// A change of up to 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WritePoint {
    /// Where the first byte is.
    pub address: MemoryAddress,
    /// What happens to this byte and to the next.
    pub masks: [PointMask; 2],
}

impl WritePoint {
    pub(super) fn parse(data: &[u8]) -> Result<WritePoint, MessageError> {
        let mask = || (be_u8, be_u8).map(|(and, or)| PointMask { and, or });
        let length = byte(|length| (length == MASKS_LEN).then_some(length));
        let fields = (length, MemoryAddress::field, mask(), mask());
        let write = fields
            .map(|(_, address, first, second)| WritePoint { address, masks: [first, second] });
        parse_data(Subfunction::WritePoint, data, LEN, write)
    }

    pub(super) fn to_data(self) -> Data {
        let [low, middle, high] = self.address.to_le_bytes();
        let [first, second] = self.masks;
        Data::from_array([MASKS_LEN, low, middle, high, first.and, first.or, second.and, second.or])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clears_outside_the_first_mask_then_sets_the_second() {
        assert_eq!(PointMask { and: 0b1111_0000, or: 0b0000_0001 }.apply(0b1010_1010), 0b1010_0001);
        for byte in 0..=255 {
            assert_eq!(PointMask::KEEP.apply(byte), byte);
        }
    }

    #[test]
    fn every_field_is_in_its_place() {
        let write = WritePoint {
            address: MemoryAddress::new(0x0003_0201).unwrap(),
            masks: [PointMask { and: 0xFE, or: 0x01 }, PointMask::KEEP],
        };
        assert_eq!(write.to_data(), [4, 1, 2, 3, 0xFE, 0x01, 0xFF, 0x00]);
        assert_eq!(WritePoint::parse(&write.to_data()), Ok(write));
        let bad =
            MessageError::BadValue { subfunction: Subfunction::WritePoint, offset: 0, value: 5 };
        assert_eq!(WritePoint::parse(&[5; 8]), Err(bad));
    }
}
