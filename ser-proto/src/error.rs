//! Why a body is not a message.

use core::fmt;

/// Why a body could not be understood. Offsets count from the command byte, which is offset 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ParseError {
    /// The body has no command byte.
    Empty,
    /// No message has this command byte.
    UnknownCode {
        /// The byte found.
        code: u8,
    },
    /// The command is known, but no message of this command and direction has this length.
    WrongLength {
        /// The command byte.
        code: u8,
        /// Bytes in the body, the command byte included.
        length: usize,
    },
    /// A reply of our extension ends before all of its fields are there. A longer one is no error:
    /// it may have grown.
    TooShort {
        /// The command byte.
        code: u8,
        /// Where the first field starts that is missing or cut off.
        offset: u16,
        /// Bytes in the body, the command byte included.
        length: usize,
    },
    /// The length is right, but a field holds a value that is not allowed.
    BadValue {
        /// The command byte.
        code: u8,
        /// Where the field starts.
        offset: usize,
        /// What the field holds.
        value: u16,
    },
    /// The entries of a read reply are neither 12 bytes (16 inputs) nor 16 bytes (32 inputs) each.
    EntrySize {
        /// The count that the reply gives.
        count: u8,
        /// The bytes that follow the header.
        bytes: usize,
    },
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            ParseError::Empty => write!(f, "empty body"),
            ParseError::UnknownCode { code } => write!(f, "unknown command byte {code:02X}h"),
            ParseError::WrongLength { code, length } => {
                write!(f, "{} never has {length} bytes", Name(code))
            }
            ParseError::TooShort { code, offset, length } => {
                write!(
                    f,
                    "{} ends after {length} bytes, before the field at byte {offset} is complete",
                    Name(code)
                )
            }
            ParseError::BadValue { code, offset, value } => {
                write!(f, "{} cannot have {value} ({value:02X}h) at byte {offset}", Name(code))
            }
            ParseError::EntrySize { count, bytes } => {
                write!(
                    f,
                    "read reply with {bytes} bytes for {count} entries (12 or 16 bytes each \
                     expected)"
                )
            }
        }
    }
}

impl core::error::Error for ParseError {}

impl ParseError {
    /// The command byte of the body, if it has one.
    #[must_use]
    pub const fn code(&self) -> Option<u8> {
        match *self {
            ParseError::Empty => None,
            ParseError::UnknownCode { code }
            | ParseError::WrongLength { code, .. }
            | ParseError::TooShort { code, .. }
            | ParseError::BadValue { code, .. } => Some(code),
            ParseError::EntrySize { .. } => Some(crate::Code::Read.byte()),
        }
    }
}

/// A command byte as a person reads it.
struct Name(u8);

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            b'A'..=b'Z' => write!(f, "message {}", self.0 as char),
            code => write!(f, "message {code:02X}h"),
        }
    }
}
