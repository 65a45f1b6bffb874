//! Why a reading cannot continue.

use std::error::Error;
use std::fmt;

/// Why a reading cannot continue. The cursor stands after the last event that was delivered; a new
/// reading from there resolves most of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbed {
    /// Total and next slot moved in a way that recording does not explain: the log was erased or
    /// resized during the reading.
    Changed,
    /// The ring does not have the size that was given.
    WrongSize,
    /// The replies bring no events although there must be some.
    NoProgress,
}

impl Disturbed {
    /// What a person can try next.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            Disturbed::Changed => "read again; does another host erase or resize the log?",
            Disturbed::WrongSize => "give the size that the recorder was configured with",
            Disturbed::NoProgress => "read again, at a higher baud rate if events come very fast",
        }
    }
}

impl fmt::Display for Disturbed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Disturbed::Changed => "the log was erased or resized while it was being read",
            Disturbed::WrongSize => "the log does not have the size that was expected",
            Disturbed::NoProgress => "the log shows events but does not hand them out",
        })
    }
}

impl Error for Disturbed {}
