//! Lives of logs.

use std::fmt;

use ser_proto::Model;
use sha2::{Digest, Sha256};

/// The name of one life of a log, from power-up or erase to the next: 64 bits, drawn at random or made
/// of what [the recorder tells](Life::of_recorder).
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

    /// The life that a recorder itself tells from all others: by the number that no other recorder
    /// has, how often it was powered up, and which life of its log this is. Whoever asks it gets the
    /// same name.
    ///
    /// It is the first eight bytes, high byte first, of the SHA-256 of `ser life 1`, the number, and
    /// the two counts with four bytes each, high byte first.
    #[must_use]
    pub fn of_recorder(id: &[u8; 12], power_ups: u32, life: u32) -> Life {
        let mut hash = Sha256::new();
        hash.update(b"ser life 1");
        hash.update(id);
        hash.update(power_ups.to_be_bytes());
        hash.update(life.to_be_bytes());
        let hash: [u8; 32] = hash.finalize().into();
        let [a, b, c, d, e, f, g, h, ..] = hash;
        // Once in 2^64 the name is taken.
        Life(u64::from_be_bytes([a, b, c, d, e, f, g, h]).max(1))
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
    fn whoever_asks_a_recorder_gets_the_same_name_and_of_another_life_another_one() {
        let id = *b"\x00\x1f\x00\x2b\x33\x47\x51\x11\x37\x35\x38\x30";
        let life = Life::of_recorder(&id, 42, 259);
        assert_eq!(life.to_string(), "b886a9e4f23bfa7d");
        let mut other = id;
        other[0] ^= 1;
        for another in [
            Life::of_recorder(&id, 42, 260),
            Life::of_recorder(&id, 43, 259),
            Life::of_recorder(&other, 42, 259),
        ] {
            assert_ne!(another, life);
        }
    }

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
