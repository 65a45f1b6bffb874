//! Lives of logs.

use std::fmt;

use ser_proto::Model;

/// The name of one life of a log, from power-up or erase to the next: 64 random bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Life(u64);

impl Life {
    /// The life of a reading that remembers nothing; written as `0`.
    pub const UNKNOWN: Life = Life(0);

    /// The life with these bits; 0 is [`UNKNOWN`](Self::UNKNOWN).
    #[must_use]
    pub const fn from_bits(bits: u64) -> Life {
        Life(bits)
    }

    /// Its bits.
    #[must_use]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Whether the life has a name.
    #[must_use]
    pub const fn is_known(self) -> bool {
        self.0 != 0
    }

    /// The life with this name, as [`Display`](fmt::Display) writes it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Life> {
        if name == "0" {
            return Some(Life::UNKNOWN);
        }
        let is_ours =
            name.len() == 16 && name.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let bits = u64::from_str_radix(name, 16).ok().filter(|&bits| is_ours && bits != 0)?;
        Some(Life(bits))
    }
}

/// As 16 hexadecimal digits, or `0`.
impl fmt::Display for Life {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("0"),
            name => write!(f, "{name:016x}"),
        }
    }
}

/// What is known of a life, apart from its entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LifeRecord {
    /// Its name.
    pub life: Life,
    /// Whether sequences count from the beginning of the log. Otherwise a multiple of 65536 may be
    /// missing in them.
    pub is_exact: bool,
    /// The recorder's model, if it is known.
    pub model: Option<Model>,
    /// How many entries its log holds, if that is known.
    pub size: Option<u16>,
    /// The life before, if the log was erased by command. The clock ran on then; after a power
    /// failure it may not have.
    pub erased: Option<Life>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_read_as_it_is_written() {
        for life in [Life::UNKNOWN, Life::from_bits(0xAB), Life::from_bits(u64::MAX)] {
            assert_eq!(Life::from_name(&life.to_string()), Some(life));
        }
        for wrong in ["", "1", "00", "+000000000000001", "000000000000000g", "AB00000000000000"] {
            assert_eq!(Life::from_name(wrong), None, "{wrong}");
        }
        assert_eq!(Life::from_name("0000000000000000"), None);
    }
}
