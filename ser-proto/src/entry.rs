//! One recorded event as the protocol carries it.
//!
//! ```text
//! 16 inputs: | changed (2) | state (2) | time stamp (8) |    12 bytes
//! 32 inputs: | changed (4) | state (4) | time stamp (8) |    16 bytes
//! ```

use core::fmt;

use nom::Parser;
use nom::combinator::map;
use nom::number::complete::{be_u16, be_u32};

use crate::fields::{Bytes, Fault};
use crate::{Body, Model, TimeStamp};

/// A set of inputs: input 1 is bit 0, input 32 is bit 31.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inputs(pub u32);

impl Inputs {
    /// Whether input `number` (1–32) is in the set.
    #[must_use]
    pub const fn contains(self, number: u8) -> bool {
        number >= 1 && number <= 32 && self.0 >> (number - 1) & 1 == 1
    }

    /// The numbers (1–32) of the inputs in the set, ascending.
    #[must_use]
    pub const fn numbers(self) -> InputNumbers {
        InputNumbers(self.0)
    }

    /// Whether no input is in the set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Iterator over the numbers of the inputs in a set; see [`Inputs::numbers`].
#[derive(Clone, Debug)]
pub struct InputNumbers(u32);

impl Iterator for InputNumbers {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        if self.0 == 0 {
            return None;
        }
        let bit = u8::try_from(self.0.trailing_zeros()).ok()?;
        self.0 &= self.0 - 1;
        Some(bit + 1)
    }
}

/// As `1 3 17`.
impl fmt::Display for Inputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, number) in self.numbers().enumerate() {
            let gap = if position == 0 { "" } else { " " };
            write!(f, "{gap}{number}")?;
        }
        Ok(())
    }
}

/// One event: the inputs that changed in the same millisecond, and the state of all inputs right
/// after the change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Entry {
    /// The inputs that changed.
    pub changed: Inputs,
    /// The inputs that are on.
    pub state: Inputs,
    /// When they changed.
    pub time: TimeStamp,
}

impl Entry {
    pub(crate) fn parser<'a>(
        model: Model,
    ) -> impl Parser<Bytes<'a>, Output = Entry, Error = Fault> {
        let inputs = move |bytes: Bytes<'a>| match model {
            Model::Ser160 => map(be_u16, |bits| Inputs(bits.into())).parse(bytes),
            Model::Ser320 => map(be_u32, Inputs).parse(bytes),
        };
        (inputs, inputs, TimeStamp::parser()).map(|(changed, state, time)| Entry {
            changed,
            state,
            time,
        })
    }

    pub(crate) fn put_on(&self, body: &mut Body, model: Model) {
        for inputs in [self.changed, self.state] {
            match model {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "the model has no inputs above 16"
                )]
                Model::Ser160 => body.put_u16(inputs.0 as u16),
                Model::Ser320 => body.put_u32(inputs.0),
            }
        }
        self.time.put_on(body);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn input_1_is_bit_0_and_input_32_is_bit_31() {
        assert_eq!(Inputs(0x8000_0005).numbers().collect::<Vec<_>>(), [1, 3, 32]);
        assert_eq!(Inputs(0x8000_0005).to_string(), "1 3 32");
        assert!(Inputs(1).contains(1));
        assert!(!Inputs(u32::MAX).contains(0));
        assert!(!Inputs(u32::MAX).contains(33));
        assert!(Inputs(0).numbers().next().is_none());
        assert_eq!(Inputs(u32::MAX).numbers().count(), 32);
    }
}
