//! The state of all inputs, which a recorder puts on the bus in every scan (manual, section "Global
//! data").
//!
//! ```text
//! 16 inputs: | inputs 1–8 | 9–16 |                      2 bytes
//! 32 inputs: | inputs 1–8 | 9–16 | 17–24 | 25–32 |      4 bytes
//! ```
//!
//! The lowest input of a byte is its bit 0.

use core::fmt;

use heapless::Vec;
use nom::Parser;
use nom::number::complete::{le_u16, le_u32};

use super::packing::gather;
use crate::fields::parse_exactly;
use crate::{Inputs, Model};

/// The global data of a recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GlobalData {
    /// The model: it decides how many bytes there are.
    pub model: Model,
    /// The inputs that are on.
    pub state: Inputs,
}

impl GlobalData {
    /// Bytes that a recorder of this model broadcasts: 2 or 4.
    #[must_use]
    pub const fn len(model: Model) -> usize {
        match model {
            Model::Ser160 => 2,
            Model::Ser320 => 4,
        }
    }

    /// Parses the global data of a recorder; their length shows the model.
    ///
    /// # Errors
    /// [`GlobalDataLength`] unless there are 2 or 4 bytes.
    pub fn parse(bytes: &[u8]) -> Result<GlobalData, GlobalDataLength> {
        let (ser160, ser320) = (le_u16.map(u32::from), le_u32);
        let state = |model, state| GlobalData { model, state: Inputs(state) };
        parse_exactly(bytes, 2, ser160.map(|bits| state(Model::Ser160, bits)))
            .or_else(|_| parse_exactly(bytes, 4, ser320.map(|bits| state(Model::Ser320, bits))))
            .map_err(|_| GlobalDataLength { length: bytes.len() })
    }

    /// The bytes on the bus. Inputs that the model does not have are left out.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8, 4> {
        gather(self.state.0.to_le_bytes().into_iter().take(GlobalData::len(self.model)))
    }
}

/// As `1 3 17`: the inputs that are on.
impl fmt::Display for GlobalData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.state.fmt(f)
    }
}

/// Global data of a length that no recorder sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GlobalDataLength {
    /// How many bytes there were.
    pub length: usize,
}

impl fmt::Display for GlobalDataLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes of global data (a recorder sends 2 or 4)", self.length)
    }
}

impl core::error::Error for GlobalDataLength {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_byte_holds_inputs_1_to_8() {
        let state = Inputs(0x8040_2001);
        assert_eq!(GlobalData { model: Model::Ser320, state }.to_bytes(), [0x01, 0x20, 0x40, 0x80]);
        assert_eq!(GlobalData { model: Model::Ser160, state }.to_bytes(), [0x01, 0x20]);
        assert_eq!(
            GlobalData::parse(&[0x01, 0x20, 0x40, 0x80]),
            Ok(GlobalData { model: Model::Ser320, state })
        );
        assert_eq!(GlobalData::parse(&[0, 0x80]).unwrap().to_string(), "16");
    }

    #[test]
    fn every_input_is_where_it_belongs() {
        for number in 1..=32_u8 {
            for model in [Model::Ser160, Model::Ser320] {
                let data = GlobalData { model, state: Inputs(1 << (number - 1) & model.mask()) };
                let bytes = data.to_bytes();
                assert_eq!(bytes.len(), GlobalData::len(model));
                assert_eq!(GlobalData::parse(&bytes), Ok(data));
                let expected = usize::from(number - 1) / 8;
                assert_eq!(
                    bytes.iter().position(|&byte| byte != 0),
                    (number <= model.inputs()).then_some(expected)
                );
            }
        }
    }

    #[test]
    fn other_lengths_are_refused() {
        for length in [0, 1, 3, 5, 128] {
            assert_eq!(GlobalData::parse(&[0; 128][..length]), Err(GlobalDataLength { length }));
        }
    }
}
