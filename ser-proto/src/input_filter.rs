//! What a recorder filters out at one input: bounces, and chatter.
//!
//! ```text
//! | debounce ms | chatter changes | window ms (2) | re-arm ms (2) |    6 bytes
//! ```
//! Without changes the chatter filter is off, and the two times behind them mean nothing; they are
//! sent as 0.

use core::fmt;
use core::num::NonZeroU8;

use nom::Parser;
use nom::combinator::map;
use nom::number::complete::{be_u8, be_u16};

use crate::Body;
use crate::fields::{Bytes, Fault};

/// The most changes that a chatter filter can be set to.
pub const MAX_CHATTER_CHANGES: u8 = 32;

/// The longest window of a chatter filter, in milliseconds: no more changes would be left for a
/// longer one.
pub const MAX_CHATTER_WINDOW_MS: u16 = 7000;

/// Changes in a second that are never chatter: an input that operates twice.
const NEVER_CHATTER_PER_SECOND: u16 = 4;

/// The filters of one input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InputFilter {
    /// How long the input must hold a new state until the change counts, in milliseconds; 0: every
    /// change counts at once.
    pub debounce_ms: u8,
    /// When the input's changes are left out; `None`: never.
    pub chatter: Option<ChatterFilter>,
}

/// When an input chatters, and when it has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChatterFilter {
    /// An input with so many changes in one window chatters. A window begins with the first change
    /// outside of the one before. 5–32, and more than four for each
    /// second of the window that has begun, so that an input that operates twice a second is never
    /// taken for chatter.
    pub changes: NonZeroU8,
    /// The length of the window, 1–7000 milliseconds.
    pub window_ms: u16,
    /// The input is believed again when it has been quiet for so long: from the window to 65535
    /// milliseconds. A shorter time could end and begin the chatter over and over.
    pub rearm_ms: u16,
}

/// A chatter filter that cannot be set: the first of these that holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InvalidFilter {
    /// More changes than [`MAX_CHATTER_CHANGES`].
    ManyChanges {
        /// The changes.
        changes: u8,
    },
    /// No window, or one above [`MAX_CHATTER_WINDOW_MS`].
    Window {
        /// The window in milliseconds.
        window_ms: u16,
    },
    /// An input that operates twice a second would be taken for chatter.
    FewChanges {
        /// The changes.
        changes: u8,
        /// The fewest that this window allows.
        least: u8,
    },
    /// The re-arm time is shorter than the window.
    Rearm {
        /// The re-arm time in milliseconds.
        rearm_ms: u16,
    },
}

impl InputFilter {
    /// No filter: every change counts at once.
    pub const OFF: InputFilter = InputFilter { debounce_ms: 0, chatter: None };

    /// Bytes on the wire.
    pub const LEN: usize = 6;

    /// The bytes on the wire, for whoever keeps them.
    #[must_use]
    pub fn to_bytes(self) -> [u8; InputFilter::LEN] {
        let (changes, window_ms, rearm_ms) = self.chatter.map_or((0, 0, 0), |chatter| {
            (chatter.changes.get(), chatter.window_ms, chatter.rearm_ms)
        });
        let ([a, b], [c, d]) = (window_ms.to_be_bytes(), rearm_ms.to_be_bytes());
        [self.debounce_ms, changes, a, b, c, d]
    }

    /// The filter with these bytes, whatever they are.
    #[must_use]
    pub fn from_bytes(bytes: [u8; InputFilter::LEN]) -> InputFilter {
        let [debounce_ms, changes, a, b, c, d] = bytes;
        let (window_ms, rearm_ms) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
        InputFilter::of_fields(debounce_ms, changes, window_ms, rearm_ms)
    }

    fn of_fields(debounce_ms: u8, changes: u8, window_ms: u16, rearm_ms: u16) -> InputFilter {
        let chatter =
            NonZeroU8::new(changes).map(|changes| ChatterFilter { changes, window_ms, rearm_ms });
        InputFilter { debounce_ms, chatter }
    }

    /// Whether the filter can be set.
    ///
    /// # Errors
    /// What is out of range. A debounce time never is.
    pub fn check(&self) -> Result<(), InvalidFilter> {
        self.chatter.map_or(Ok(()), ChatterFilter::check)
    }

    /// Takes any values: those of a recorder are shown as they are.
    pub(crate) fn parser<'a>() -> impl Parser<Bytes<'a>, Output = InputFilter, Error = Fault> {
        map((be_u8, be_u8, be_u16, be_u16), |(debounce_ms, changes, window_ms, rearm_ms)| {
            InputFilter::of_fields(debounce_ms, changes, window_ms, rearm_ms)
        })
    }

    pub(crate) fn put_on(&self, body: &mut Body) {
        body.put(&self.to_bytes());
    }
}

impl ChatterFilter {
    fn check(self) -> Result<(), InvalidFilter> {
        let ChatterFilter { changes, window_ms, rearm_ms } = self;
        let changes = changes.get();
        let least = 1 + NEVER_CHATTER_PER_SECOND * window_ms.div_ceil(1000);
        if changes > MAX_CHATTER_CHANGES {
            Err(InvalidFilter::ManyChanges { changes })
        } else if window_ms == 0 || window_ms > MAX_CHATTER_WINDOW_MS {
            Err(InvalidFilter::Window { window_ms })
        } else if u16::from(changes) < least {
            let least = u8::try_from(least).unwrap_or(MAX_CHATTER_CHANGES);
            Err(InvalidFilter::FewChanges { changes, least })
        } else if rearm_ms < window_ms {
            Err(InvalidFilter::Rearm { rearm_ms })
        } else {
            Ok(())
        }
    }
}

impl InvalidFilter {
    /// Where the field starts among the six bytes.
    pub(crate) const fn offset(self) -> usize {
        match self {
            InvalidFilter::ManyChanges { .. } | InvalidFilter::FewChanges { .. } => 1,
            InvalidFilter::Window { .. } => 2,
            InvalidFilter::Rearm { .. } => 4,
        }
    }

    /// What the field holds.
    pub(crate) const fn value(self) -> u16 {
        match self {
            InvalidFilter::ManyChanges { changes } | InvalidFilter::FewChanges { changes, .. } => {
                changes as u16
            }
            InvalidFilter::Window { window_ms } => window_ms,
            InvalidFilter::Rearm { rearm_ms } => rearm_ms,
        }
    }
}

/// As `debounce 5 ms, chatter from 10 changes in 1000 ms until quiet for 2000 ms` or `debounce off,
/// chatter filter off`.
impl fmt::Display for InputFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.debounce_ms {
            0 => f.write_str("debounce off, ")?,
            time_ms => write!(f, "debounce {time_ms} ms, ")?,
        }
        match self.chatter {
            None => f.write_str("chatter filter off"),
            Some(ChatterFilter { changes, window_ms, rearm_ms }) => write!(
                f,
                "chatter from {changes} changes in {window_ms} ms until quiet for {rearm_ms} ms"
            ),
        }
    }
}

impl fmt::Display for InvalidFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InvalidFilter::ManyChanges { changes } => {
                write!(
                    f,
                    "chatter from {changes} changes: at most {MAX_CHATTER_CHANGES} can be set"
                )
            }
            InvalidFilter::Window { window_ms } => write!(
                f,
                "a window of {window_ms} ms: it can be 1 to {MAX_CHATTER_WINDOW_MS} ms long"
            ),
            InvalidFilter::FewChanges { changes, least } => write!(
                f,
                "chatter from {changes} changes: an input that operates twice a second would be \
                 taken for it, in this window from {least} changes on it is not"
            ),
            InvalidFilter::Rearm { rearm_ms } => {
                write!(f, "a re-arm time of {rearm_ms} ms: it cannot be shorter than the window")
            }
        }
    }
}

impl core::error::Error for InvalidFilter {}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(changes: u8, window_ms: u16, rearm_ms: u16) -> Result<(), InvalidFilter> {
        let changes = NonZeroU8::new(changes).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms, rearm_ms });
        InputFilter { debounce_ms: 255, chatter }.check()
    }

    #[test]
    fn each_range_ends_where_it_is_written() {
        assert_eq!(InputFilter::OFF.check(), Ok(()));
        assert_eq!(checked(5, 1, 1), Ok(()));
        assert_eq!(checked(5, 1000, 1000), Ok(()));
        assert_eq!(checked(32, 7000, u16::MAX), Ok(()));
        assert_eq!(checked(33, 1000, 1000), Err(InvalidFilter::ManyChanges { changes: 33 }));
        assert_eq!(checked(32, 0, 1000), Err(InvalidFilter::Window { window_ms: 0 }));
        assert_eq!(checked(32, 7001, 8000), Err(InvalidFilter::Window { window_ms: 7001 }));
        assert_eq!(checked(4, 1, 1), Err(InvalidFilter::FewChanges { changes: 4, least: 5 }));
        assert_eq!(checked(8, 1001, 1001), Err(InvalidFilter::FewChanges { changes: 8, least: 9 }));
        assert_eq!(checked(9, 1001, 1001), Ok(()));
        assert_eq!(
            checked(28, 7000, 7000),
            Err(InvalidFilter::FewChanges { changes: 28, least: 29 })
        );
        assert_eq!(checked(10, 1000, 999), Err(InvalidFilter::Rearm { rearm_ms: 999 }));
    }

    #[test]
    fn a_filter_and_what_is_wrong_with_one_read_well() {
        assert_eq!(InputFilter::OFF.to_string(), "debounce off, chatter filter off");
        let changes = NonZeroU8::new(10).unwrap();
        let chatter = Some(ChatterFilter { changes, window_ms: 1000, rearm_ms: 2000 });
        assert_eq!(
            InputFilter { debounce_ms: 5, chatter }.to_string(),
            "debounce 5 ms, chatter from 10 changes in 1000 ms until quiet for 2000 ms"
        );
        assert_eq!(
            InvalidFilter::Window { window_ms: 0 }.to_string(),
            "a window of 0 ms: it can be 1 to 7000 ms long"
        );
    }
}
