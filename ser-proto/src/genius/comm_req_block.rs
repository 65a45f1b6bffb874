//! What the `COMM_REQ` blocks have in common (manual, section "Datagrams").
//!
//! ```text
//! word  0        | 1        | 2                     | 3                  | 4        | 5        | 6
//!       length   | 0: do    | memory type of the    | number in it,      | 0: idle  | 0: time  | command
//!                | not wait | status word           | minus one          | timeout  | limit    |
//! ```

use core::fmt;

use super::{Address, MemoryType, PlcReference};

/// Words before the command's own; the length in word 0 counts from the command word on.
pub(super) const HEADER_LEN: usize = 6;

/// Words 0–6 of a block.
pub(super) fn start(length: u16, status: PlcReference, command: u16) -> [u16; HEADER_LEN + 1] {
    [length, 0, status.memory.0, status.offset(), 0, 0, command]
}

/// The words of a block that came from a PLC.
#[derive(Clone, Copy)]
pub(super) struct Block<'a>(pub(super) &'a [u16]);

impl<'a> Block<'a> {
    /// Checks words 1–6, and returns where the status word is.
    pub(super) fn parse_start(self, command: u16) -> Result<PlcReference, CommReqError> {
        self.word(6, exactly(command))?;
        self.word(1, exactly(0))?;
        let status = self.reference(2)?;
        self.word(4, exactly(0))?;
        self.word(5, exactly(0))?;
        Ok(status)
    }

    /// The word at `index`; `accept` turns it into its meaning or refuses it.
    pub(super) fn word<T>(
        self,
        index: usize,
        accept: impl FnOnce(u16) -> Option<T>,
    ) -> Result<T, CommReqError> {
        let &value = self.0.get(index).ok_or(CommReqError::Missing { index })?;
        accept(value).ok_or(CommReqError::BadWord { index, value })
    }

    /// The memory type at `index` and the offset after it.
    pub(super) fn reference(self, index: usize) -> Result<PlcReference, CommReqError> {
        let memory = self.word(index, |code| Some(MemoryType(code)))?;
        let number = self.word(index + 1, PlcReference::number_at)?;
        Ok(PlcReference { memory, number })
    }

    /// The words from `index` on. There must be `count`, or up to `most` when a PLC also hands over
    /// the words after the block.
    pub(super) fn rest(
        self,
        index: usize,
        count: usize,
        most: usize,
    ) -> Result<&'a [u16], CommReqError> {
        let rest = self.0.get(index..).unwrap_or_default();
        match rest.get(..count) {
            None => Err(CommReqError::Missing { index: self.0.len() }),
            Some(_) if rest.len() > most.max(count) => {
                Err(CommReqError::TooManyWords { words: self.0.len() })
            }
            Some(words) => Ok(words),
        }
    }
}

/// Accepts `expected` only.
pub(super) fn exactly(expected: u16) -> impl Fn(u16) -> Option<()> {
    move |value| (value == expected).then_some(())
}

/// A word that holds a byte.
pub(super) fn byte(value: u16) -> Option<u8> {
    u8::try_from(value).ok()
}

/// A word that holds a bus address, or 255 for all.
pub(super) fn address(value: u16) -> Option<Address> {
    byte(value).and_then(Address::from_number)
}

/// Why words are not a `COMM_REQ` block that this crate knows. Words count from 0, as in the
/// manual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommReqError {
    /// The block ends before this word.
    Missing {
        /// The word that is not there.
        index: usize,
    },
    /// A word holds a value that is not allowed.
    BadWord {
        /// Which word.
        index: usize,
        /// What it holds.
        value: u16,
    },
    /// There are more words than the block has.
    TooManyWords {
        /// How many words there are.
        words: usize,
    },
}

impl fmt::Display for CommReqError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            CommReqError::Missing { index } => {
                write!(f, "the COMM_REQ block ends before word {index}")
            }
            CommReqError::BadWord { index, value } => {
                write!(f, "word {index} of a COMM_REQ block cannot be {value} ({value:04X}h)")
            }
            CommReqError::TooManyWords { words } => {
                write!(f, "{words} words are more than the COMM_REQ block has")
            }
        }
    }
}

impl core::error::Error for CommReqError {}
