//! How patient a host is.

use std::time::Duration;

/// How patient to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How long a recorder may take to answer, on top of the time that the bytes are on the line.
    /// Behind a terminal server that time is not known, so a slow line there wants a longer
    /// timeout.
    pub timeout: Duration,
    /// How often a request is repeated when no answer comes. Requests that must not be carried out
    /// twice never are.
    pub retries: u32,
}

/// One second, and two repeats.
impl Default for Options {
    fn default() -> Self {
        Options { timeout: Duration::from_secs(1), retries: 2 }
    }
}
