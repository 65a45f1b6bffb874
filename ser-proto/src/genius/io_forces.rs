//! Read I/O Forces and its reply, subfunctions 40h and 41h (Bus Interface Unit manual, GFK-0825).
//!
//! ```text
//! request: | table |                     1 byte
//! reply:   | table | its contents … |    1 byte, and at most 128 of contents
//! ```
//!
//! A table has one byte for every eight discrete points, then one word for every analog channel.

use core::fmt;

use heapless::Vec;
use nom::combinator::rest;

use super::message_error::parse_data;
use super::packing::gather;
use super::{Data, GlobalData, MessageError, Subfunction};
use crate::Model;
use crate::fields::byte;

/// The most bytes of a force table that one reply carries, after the byte that names the table.
pub const MAX_FORCE_TABLE: usize = 128;

/// The four force tables of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum ForceTable {
    /// Which inputs are forced.
    InputEnable = 0,
    /// Which outputs are forced.
    OutputEnable = 1,
    /// What the inputs are forced to.
    InputValues = 2,
    /// What the outputs are forced to.
    OutputValues = 3,
}

impl ForceTable {
    /// All four, in the order of their codes.
    pub const ALL: [ForceTable; 4] = [
        ForceTable::InputEnable,
        ForceTable::OutputEnable,
        ForceTable::InputValues,
        ForceTable::OutputValues,
    ];

    /// The table with code `code`, 0–3.
    #[must_use]
    pub fn from_code(code: u8) -> Option<ForceTable> {
        ForceTable::ALL.into_iter().find(|table| table.code() == code)
    }

    /// The code, 0–3.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    pub(super) fn parse(data: &[u8]) -> Result<ForceTable, MessageError> {
        parse_data(Subfunction::ReadIoForces, data, 1, byte(ForceTable::from_code))
    }

    pub(super) fn to_data(self) -> Data {
        Data::from_array([self.code()])
    }
}

/// As `input enable`.
impl fmt::Display for ForceTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            ForceTable::InputEnable => "input enable",
            ForceTable::OutputEnable => "output enable",
            ForceTable::InputValues => "input values",
            ForceTable::OutputValues => "output values",
        })
    }
}

/// One force table of a device: the reply to Read I/O Forces.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct IoForces {
    /// Which table.
    pub table: ForceTable,
    /// What it contains; empty when the device has no such points.
    pub contents: Vec<u8, MAX_FORCE_TABLE>,
}

impl IoForces {
    /// The table of a recorder, which never forces an input and has no outputs.
    #[must_use]
    pub fn none(table: ForceTable, model: Model) -> IoForces {
        let len = match table {
            ForceTable::InputEnable | ForceTable::InputValues => GlobalData::len(model),
            ForceTable::OutputEnable | ForceTable::OutputValues => 0,
        };
        IoForces { table, contents: gather(core::iter::repeat_n(0, len)) }
    }

    pub(super) fn parse(data: &[u8]) -> Result<IoForces, MessageError> {
        let subfunction = Subfunction::ReadIoForcesReply;
        let (table, contents) =
            parse_data(subfunction, data, data.len(), (byte(ForceTable::from_code), rest))?;
        let contents = Vec::from_slice(contents)
            .map_err(|_| MessageError::WrongLength { subfunction, length: data.len() })?;
        Ok(IoForces { table, contents })
    }

    pub(super) fn to_data(&self) -> Data {
        gather(core::iter::once(self.table.code()).chain(self.contents.iter().copied()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recorder_forces_nothing_and_has_no_outputs() {
        assert_eq!(IoForces::none(ForceTable::InputEnable, Model::Ser160).to_data(), [0, 0, 0]);
        assert_eq!(
            IoForces::none(ForceTable::InputValues, Model::Ser320).to_data(),
            [2, 0, 0, 0, 0]
        );
        assert_eq!(IoForces::none(ForceTable::OutputEnable, Model::Ser320).to_data(), [1]);
        assert_eq!(IoForces::none(ForceTable::OutputValues, Model::Ser160).to_data(), [3]);
    }

    #[test]
    fn a_table_of_128_bytes_survives_and_one_of_129_is_refused() {
        let mut data = vec![3; 129];
        let forces = IoForces::parse(&data).unwrap();
        assert_eq!((forces.table, forces.contents.len()), (ForceTable::OutputValues, 128));
        assert_eq!(forces.to_data(), &data[..]);
        data.push(0);
        let subfunction = Subfunction::ReadIoForcesReply;
        assert_eq!(
            IoForces::parse(&data),
            Err(MessageError::WrongLength { subfunction, length: 130 })
        );
    }

    #[test]
    fn a_fifth_table_is_refused_in_both_directions() {
        let bad = |subfunction| MessageError::BadValue { subfunction, offset: 0, value: 4 };
        assert_eq!(ForceTable::parse(&[4]), Err(bad(Subfunction::ReadIoForces)));
        assert_eq!(IoForces::parse(&[4, 0]), Err(bad(Subfunction::ReadIoForcesReply)));
    }
}
