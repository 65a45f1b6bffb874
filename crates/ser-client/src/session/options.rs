//! How long a host waits for an answer, and how often it asks.

use std::time::Duration;

/// How long a host waits for an answer, and how often it asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How long a recorder may take to answer, on top of the time that the bytes are on the line.
    /// With a terminal server that time is unknown, so a slow line there needs a longer timeout.
    pub timeout: Duration,
    /// How often a request is repeated when no answer comes. Requests that must not be carried out
    /// twice are never repeated.
    pub retries: u32,
}

/// One second and two repeats.
impl Default for Options {
    fn default() -> Self {
        Options { timeout: Duration::from_secs(1), retries: 2 }
    }
}
