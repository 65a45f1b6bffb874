//! The number that tells a recorder from all others, as its microcontroller has it from the
//! factory.

use core::fmt;

use nom::Parser;
use nom::bytes::complete::take;
use nom::combinator::map;

use crate::fields::{Bytes, Fault};

/// The number of one recorder. Never all zero: on the wire that says that there is none, and two
/// recorders without a number must not pass for one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RecorderId([u8; RecorderId::LEN]);

impl RecorderId {
    /// Bytes on the wire.
    pub const LEN: usize = 12;

    /// The id of these bytes; `None` when all are zero.
    #[must_use]
    pub fn new(bytes: [u8; RecorderId::LEN]) -> Option<RecorderId> {
        (bytes != [0; RecorderId::LEN]).then_some(RecorderId(bytes))
    }

    /// The bytes on the wire.
    #[must_use]
    pub const fn bytes(&self) -> [u8; RecorderId::LEN] {
        self.0
    }

    pub(crate) fn to_bytes(id: Option<RecorderId>) -> [u8; RecorderId::LEN] {
        id.map_or([0; RecorderId::LEN], |id| id.0)
    }

    pub(crate) fn parser<'a>() -> impl Parser<Bytes<'a>, Output = Option<RecorderId>, Error = Fault>
    {
        map(take(RecorderId::LEN), |bytes: Bytes<'a>| {
            bytes.try_into().ok().and_then(RecorderId::new)
        })
    }
}

/// As 24 hexadecimal digits.
impl fmt::Display for RecorderId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_reads_as_its_bytes_and_zeros_are_none() {
        let id = RecorderId::new([0, 0x1F, 0xA0, 3, 4, 5, 6, 7, 8, 9, 10, 0xFF]).unwrap();
        assert_eq!(id.to_string(), "001fa0030405060708090aff");
        assert_eq!(RecorderId::new([0; 12]), None);
        assert_eq!(RecorderId::to_bytes(Some(id)), id.bytes());
        assert_eq!(RecorderId::to_bytes(None), [0; 12]);
    }
}
