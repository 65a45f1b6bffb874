//! Why a datagram of function code 20h does not have the layout of its subfunction.

use core::fmt;

use super::{FUNCTION_GENIUS, Subfunction};

/// Why a datagram could not be understood. Offsets count from the first data byte, which is offset 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MessageError {
    /// The function code is not [`FUNCTION_GENIUS`].
    WrongFunction {
        /// The code found.
        function: u8,
    },
    /// This datagram never has that many data bytes.
    WrongLength {
        /// Which datagram.
        subfunction: Subfunction,
        /// Data bytes found.
        length: usize,
    },
    /// The length is right and a field holds a value that it cannot have.
    BadValue {
        /// Which datagram.
        subfunction: Subfunction,
        /// Where the field starts.
        offset: usize,
        /// What it holds.
        value: u8,
    },
}

impl fmt::Display for MessageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MessageError::WrongFunction { function } => {
                write!(f, "function code {function:02X}h is not the bus's own ({FUNCTION_GENIUS:02X}h)")
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
