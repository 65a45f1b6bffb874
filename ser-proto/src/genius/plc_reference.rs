//! A place in a PLC's memory, as in `%R100`.

use core::fmt;
use core::num::NonZeroU16;

/// A kind of PLC memory, by the code that `COMM_REQ` blocks use. PLCs have more kinds than are
/// named here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryType(pub u16);

impl MemoryType {
    /// `%R`, the usual one.
    pub const REGISTERS: MemoryType = MemoryType(8);
    /// `%AI`.
    pub const ANALOG_INPUTS: MemoryType = MemoryType(10);
    /// `%AQ`.
    pub const ANALOG_OUTPUTS: MemoryType = MemoryType(12);
    /// `%I`.
    pub const INPUTS: MemoryType = MemoryType(70);
    /// `%Q`.
    pub const OUTPUTS: MemoryType = MemoryType(72);
    /// `%W`.
    pub const BULK: MemoryType = MemoryType(196);

    /// The name in PLC programs, if the kind is named here.
    #[must_use]
    pub const fn name(self) -> Option<&'static str> {
        match self {
            MemoryType::REGISTERS => Some("%R"),
            MemoryType::ANALOG_INPUTS => Some("%AI"),
            MemoryType::ANALOG_OUTPUTS => Some("%AQ"),
            MemoryType::INPUTS => Some("%I"),
            MemoryType::OUTPUTS => Some("%Q"),
            MemoryType::BULK => Some("%W"),
            MemoryType(_) => None,
        }
    }
}

/// A place in a PLC's memory. Numbers count from 1; a block holds the number minus one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PlcReference {
    /// Which memory.
    pub memory: MemoryType,
    /// Which place in it, from 1.
    pub number: NonZeroU16,
}

impl PlcReference {
    /// Register `number`, from 1: `%R100` for 100.
    #[must_use]
    pub const fn register(number: u16) -> Option<PlcReference> {
        match NonZeroU16::new(number) {
            Some(number) => Some(PlcReference { memory: MemoryType::REGISTERS, number }),
            None => None,
        }
    }

    /// The number as a block holds it: one less.
    #[must_use]
    pub const fn offset(self) -> u16 {
        self.number.get() - 1
    }

    /// The number for an offset in a block. The largest offset has none.
    pub(super) fn number_at(offset: u16) -> Option<NonZeroU16> {
        offset.checked_add(1).and_then(NonZeroU16::new)
    }
}

/// As `%R100`, or `memory 16 place 100` where the memory has no name.
impl fmt::Display for PlcReference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.memory.name() {
            Some(name) => write!(f, "{name}{}", self.number),
            None => write!(f, "memory {} place {}", self.memory.0, self.number),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_numbers_minus_one() {
        let register = PlcReference::register(100).unwrap();
        assert_eq!((register.offset(), register.to_string().as_str()), (99, "%R100"));
        assert_eq!(PlcReference::register(0), None);
        assert_eq!(PlcReference::number_at(0).unwrap().get(), 1);
        assert_eq!(PlcReference::number_at(u16::MAX), None);
        let unnamed = PlcReference { memory: MemoryType(16), ..register };
        assert_eq!(unnamed.to_string(), "memory 16 place 100");
    }
}
