//! How a board is to be driven.

use crate::interrupts::Interrupts;
use crate::setup_table::Configuration;
use crate::timing;

/// State of the board at the first poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Start {
    /// Unknown: it is reset for this long.
    Reset {
        /// Milliseconds; use [`timing::POWER_UP_RESET_MS`] when the supply may only just have come
        /// up.
        hold_ms: u32,
    },
    /// Its reset is released at the first call of `poll`, or was a moment before.
    Released,
    /// It has been running for seconds.
    Running,
}

/// How requests for this host's memory are handled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Requests {
    /// All are refused: the host has no memory to be read or written.
    Refuse,
    /// Each becomes an [`Event::Request`](crate::Event::Request) and waits for an answer.
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
    /// Whether the host drives the reset line. Without it the driver can only wait for a failed
    /// board.
    pub reset_line: bool,
    /// How long the board may go without a heartbeat: [`timing::HEARTBEAT_TIMEOUT_MS`], or more for
    /// a board that runs in the time of a busy computer. Such a board may stall at any moment, so
    /// this is also the minimum for [`timing::TRANSMIT_TIMEOUT_MS`], [`timing::REPLY_TIMEOUT_MS`],
    /// [`timing::COMMAND_STUCK_MS`] and [`timing::LOCKOUT_STUCK_MS`].
    pub heartbeat_timeout_ms: u32,
    /// The conditions that interrupt the host. Flags of other conditions are found within
    /// [`timing::FLAGS_PERIOD_MS`].
    pub interrupts: Interrupts,
    /// How requests for this host's memory are handled.
    pub requests: Requests,
}

impl Options {
    /// A board that is reset at power-up and whenever it fails. All interrupts are enabled except
    /// the one in every scan, and all requests for memory are refused.
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

    /// The minimum for every other time limit of the board.
    pub(crate) const fn patience_ms(&self) -> u32 {
        self.heartbeat_timeout_ms
    }
}
