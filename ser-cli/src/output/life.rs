//! Names the log that an event belongs to.
//!
//! A log lives from power-up or erase to the next. The recorder has no name for its lives, so a
//! program that remembers from run to run draws one at random. Together with the sequence, the name
//! distinguishes an event from all others.

use std::fmt;
use std::io;

/// The name of one life of a log: 64 random bits, written as 16 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Life(u64);

impl Life {
    /// The life of a reading that remembers nothing; written as `0`.
    pub const UNKNOWN: Life = Life(0);

    /// A new name, for a life that becomes known now.
    ///
    /// # Errors
    /// When the system provides no random numbers.
    pub(crate) fn begin() -> io::Result<Life> {
        loop {
            match getrandom::u64()? {
                // 0 is the unknown life.
                0 => {}
                name => return Ok(Life(name)),
            }
        }
    }

    /// The life with this name, as written by [`Display`](fmt::Display).
    pub(crate) fn from_name(name: &str) -> Option<Life> {
        let value = u64::from_str_radix(name, 16).ok()?;
        Some(Life(value)).filter(|life| life.to_string() == name)
    }
}

impl fmt::Display for Life {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("0"),
            name => write!(f, "{name:016x}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_read_as_it_is_written() {
        let life = Life::begin().unwrap();
        assert_ne!(life, Life::begin().unwrap());
        for (name, life) in [(life.to_string(), Some(life)), ("0".to_string(), Some(Life::UNKNOWN))]
        {
            assert_eq!(Life::from_name(&name), life);
        }
        for wrong in ["", "1", "00", "+000000000000001", "000000000000000g", "AB00000000000000"] {
            assert_eq!(Life::from_name(wrong), None, "{wrong}");
        }
        assert_eq!(Life(0xAB).to_string(), "00000000000000ab");
    }
}
