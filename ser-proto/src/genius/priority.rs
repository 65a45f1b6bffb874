//! How urgent a datagram is.

use core::fmt;

/// When a device may send a datagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Priority {
    /// Only if no other device has sent one in this bus scan. Code 0.
    #[default]
    Normal,
    /// On the sender's next turn in any case, which lengthens the scan for all devices. Code 1.
    High,
}

impl Priority {
    /// The priority with code `code`, 0 or 1.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Priority> {
        match code {
            0 => Some(Priority::Normal),
            1 => Some(Priority::High),
            _ => None,
        }
    }

    /// The code, 0 or 1.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Priority::Normal => 0,
            Priority::High => 1,
        }
    }
}

/// As `normal`.
impl fmt::Display for Priority {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Priority::Normal => "normal",
            Priority::High => "high",
        })
    }
}
