//! Why a datagram of function code 20h does not have the layout of its subfunction.

use core::fmt;

use nom::Parser;

use super::{FUNCTION_GENIUS, Subfunction};
use crate::fields::{Bytes, Fault, Refusal, parse_exactly};

/// Why a datagram could not be understood. Offsets count from the first data byte, which is offset
/// 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MessageError {
    /// The function code is not [`FUNCTION_GENIUS`].
    WrongFunction {
        /// The code found.
        function: u8,
    },
    /// This datagram never has this many data bytes.
    WrongLength {
        /// Which datagram.
        subfunction: Subfunction,
        /// Data bytes found.
        length: usize,
    },
    /// The length is right, but a field holds a value that is not allowed.
    BadValue {
        /// Which datagram.
        subfunction: Subfunction,
        /// Where the field starts.
        offset: usize,
        /// What it holds.
        value: u8,
    },
}

/// Parses the data of a datagram, which must be `expected_len` bytes.
pub(super) fn parse_data<'a, T>(
    subfunction: Subfunction,
    data: Bytes<'a>,
    expected_len: usize,
    parser: impl Parser<Bytes<'a>, Output = T, Error = Fault>,
) -> Result<T, MessageError> {
    parse_exactly(data, expected_len, parser).map_err(|refusal| match refusal {
        Refusal::Length => MessageError::WrongLength { subfunction, length: data.len() },
        // Every field that is checked here is one byte wide.
        Refusal::Value { offset, value } => {
            let [_, value] = value.to_be_bytes();
            MessageError::BadValue { subfunction, offset, value }
        }
    })
}

impl fmt::Display for MessageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MessageError::WrongFunction { function } => {
                write!(
                    f,
                    "function code {function:02X}h is not the bus's own ({FUNCTION_GENIUS:02X}h)"
                )
            }
            MessageError::WrongLength { subfunction, length } => {
                write!(f, "{subfunction} never has {length} data bytes")
            }
            MessageError::BadValue { subfunction, offset, value } => {
                write!(f, "{subfunction} cannot have {value} ({value:02X}h) at byte {offset}")
            }
        }
    }
}

impl core::error::Error for MessageError {}
