//! How a board is to be driven.

use crate::interrupts::Interrupts;
use crate::setup_table::Configuration;
use crate::timing;

/// State of the board when the driver begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Start {
    /// Unknown: it is reset for this long.
    Reset {
        /// Milliseconds; [`timing::POWER_UP_RESET_MS`] when the supply may have come up just now.
        hold_ms: u32,
    },
    /// Its reset was released at the first call of `poll` or less than a moment before.
    Released,
    /// It has been running for seconds.
    Running,
}

/// What is done with requests for this host's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Requests {
    /// All are refused: there is no memory to be read or written.
    Refuse,
    /// They become [`Event::Request`](crate::Event::Request) and wait for an answer.
    Ask,
}

/// How a board is to be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Options {
    /// Lengths and reference address.
    pub configuration: Configuration,
    /// State of the board.
    pub start: Start,
    /// Whether the host drives the reset line. Without it a failed board can only be waited for.
    pub reset_line: bool,
    /// How long the board may go without a heartbeat, [`timing::HEARTBEAT_TIMEOUT_MS`] or, for one
    /// that runs in the time of a busy computer, more. Such a board may stand still at any moment,
    /// so it gets at least this long for everything else, too: [`timing::TRANSMIT_TIMEOUT_MS`],
    /// [`timing::REPLY_TIMEOUT_MS`], [`timing::COMMAND_STUCK_MS`] and [`timing::LOCKOUT_STUCK_MS`].
    pub heartbeat_timeout_ms: u32,
    /// What interrupts the host. Flags that do not are found within [`timing::FLAGS_PERIOD_MS`].
    pub interrupts: Interrupts,
    /// What is done with requests for this host's memory.
    pub requests: Requests,
}

impl Options {
    /// A board that is reset at power-up and whenever it fails, with all interrupts but the one in
    /// every scan, and all requests for memory refused.
    #[must_use]
    pub const fn new(configuration: Configuration) -> Options {
        Options {
            configuration,
            start: Start::Reset { hold_ms: timing::POWER_UP_RESET_MS },
            reset_line: true,
            heartbeat_timeout_ms: timing::HEARTBEAT_TIMEOUT_MS,
            interrupts: Interrupts::ALL.without(Interrupts::OUTPUTS_SENT),
            requests: Requests::Refuse,
        }
    }

    /// What everything that the board does may take, at least.
    pub(crate) const fn patience_ms(&self) -> u32 {
        self.heartbeat_timeout_ms
    }
}
