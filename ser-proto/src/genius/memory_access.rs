//! Read Device, its reply, and Write Device, subfunctions 1Eh, 1Fh and 20h: access to a host's
//! memory.
//!
//! ```text
//! Read Device:                       | length | address (3, low first) |              4 bytes
//! Read Device reply, Write Device:   | length | address (3, low first) | contents … | 4 + length bytes
//! ```
//!
//! A GENI board shows such datagrams in this order in its request queue, and sends them back in
//! this order (GENI manual, chapter 13). The order on the bus is not published; see
//! `docs/genius.md`.

use core::fmt;

use heapless::Vec;
use nom::combinator::rest;
use nom::number::complete::le_u24;
use nom::{IResult, Parser};

use super::message_error::parse_data;
use super::packing::gather;
use super::{Data, MAX_DATA, MessageError, Subfunction};
use crate::fields::{Bytes, Fault, byte};

/// Bytes before the contents.
const HEADER_LEN: usize = 4;

/// The most bytes of memory that one datagram carries after the header: the data size of a buffer
/// in the request queue (GENI manual, chapter 13).
pub const MAX_MEMORY_DATA: usize = 128;
const _: () = assert!(HEADER_LEN + MAX_MEMORY_DATA <= MAX_DATA);

/// An address in a host's memory: 24 bits whose meaning is up to the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryAddress(u32);

impl MemoryAddress {
    /// The place at `address`, below 2²⁴.
    #[must_use]
    pub const fn new(address: u32) -> Option<MemoryAddress> {
        if address < 1 << 24 { Some(MemoryAddress(address)) } else { None }
    }

    /// The address, below 2²⁴.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// The field of a message, low byte first.
    pub(super) fn field(bytes: Bytes<'_>) -> IResult<Bytes<'_>, MemoryAddress, Fault> {
        le_u24.map(MemoryAddress).parse(bytes)
    }

    pub(super) const fn to_le_bytes(self) -> [u8; 3] {
        let [low, middle, high, _] = self.0.to_le_bytes();
        [low, middle, high]
    }
}

/// As `00AB12h`.
impl fmt::Display for MemoryAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:06X}h", self.0)
    }
}

/// What a Read Device asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryRange {
    /// Where it starts.
    pub address: MemoryAddress,
    /// How many bytes, 0–[`MAX_MEMORY_DATA`].
    pub length: u8,
}

impl MemoryRange {
    pub(super) fn parse(data: &[u8]) -> Result<MemoryRange, MessageError> {
        let length = byte(|length| (usize::from(length) <= MAX_MEMORY_DATA).then_some(length));
        let range =
            (length, MemoryAddress::field).map(|(length, address)| MemoryRange { address, length });
        parse_data(Subfunction::ReadDevice, data, HEADER_LEN, range)
    }

    pub(super) fn to_data(self) -> Data {
        let [low, middle, high] = self.address.to_le_bytes();
        Data::from_array([self.length, low, middle, high])
    }
}

/// A piece of a host's memory: what a Write Device brings and a Read Device reply returns.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryContents {
    /// Where it starts.
    pub address: MemoryAddress,
    /// The bytes that are there, or that are to be written.
    pub contents: Vec<u8, MAX_MEMORY_DATA>,
}

impl MemoryContents {
    pub(super) fn parse(
        subfunction: Subfunction,
        data: &[u8],
    ) -> Result<MemoryContents, MessageError> {
        let wrong_length = MessageError::WrongLength { subfunction, length: data.len() };
        let contents = data.get(HEADER_LEN..).ok_or(wrong_length)?;
        let contents = Vec::from_slice(contents).map_err(|_| wrong_length)?;
        let length = byte(|length| (usize::from(length) == contents.len()).then_some(length));
        let (_, address, _) =
            parse_data(subfunction, data, data.len(), (length, MemoryAddress::field, rest))?;
        Ok(MemoryContents { address, contents })
    }

    pub(super) fn to_data(&self) -> Data {
        let length = u8::try_from(self.contents.len()).unwrap_or(u8::MAX);
        gather(
            core::iter::once(length)
                .chain(self.address.to_le_bytes())
                .chain(self.contents.iter().copied()),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_24_bits_and_its_low_byte_first() {
        assert_eq!(MemoryAddress::new(0x0100_0000), None);
        let address = MemoryAddress::new(0x00AB_CD12).unwrap();
        assert_eq!(address.to_string(), "ABCD12h");
        let range = MemoryRange { address, length: 128 };
        assert_eq!(range.to_data(), [128, 0x12, 0xCD, 0xAB]);
        assert_eq!(MemoryRange::parse(&range.to_data()), Ok(range));
    }

    #[test]
    fn more_than_128_bytes_cannot_be_asked_for() {
        let bad =
            MessageError::BadValue { subfunction: Subfunction::ReadDevice, offset: 0, value: 129 };
        assert_eq!(MemoryRange::parse(&[129, 0, 0, 0]), Err(bad));
    }

    #[test]
    fn the_length_is_the_one_of_the_contents() {
        let subfunction = Subfunction::WriteDevice;
        let contents = MemoryContents {
            address: MemoryAddress::new(7).unwrap(),
            contents: core::iter::repeat_n(0x55, MAX_MEMORY_DATA).collect(),
        };
        let mut data = contents.to_data();
        assert_eq!(data.len(), 132);
        assert_eq!(MemoryContents::parse(subfunction, &data), Ok(contents));
        data[0] -= 1;
        let bad = MessageError::BadValue { subfunction, offset: 0, value: 127 };
        assert_eq!(MemoryContents::parse(subfunction, &data), Err(bad));
        data[0] = 129;
        data.push(0x55).unwrap();
        let long = MessageError::WrongLength { subfunction, length: 133 };
        assert_eq!(MemoryContents::parse(subfunction, &data), Err(long));
        let short = MessageError::WrongLength { subfunction, length: 3 };
        assert_eq!(MemoryContents::parse(subfunction, &[0, 0, 0]), Err(short));
    }
}
