//! How the Genius port and its board are set up.

use geni_board::{Configuration, Interrupts, Options, Start, timing};
use ser_proto::Model;

/// No reference address is assigned.
const NO_REFERENCE: u16 = 0xFFFF;

/// How the port is set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeniusOptions {
    /// The recorder's model, which decides the length of its global data.
    pub model: Model,
    /// State of the board when the port begins.
    pub start: Start,
    /// Whether [`GeniusPort::reset_held`](super::GeniusPort::reset_held) reaches the board. Without
    /// it, the recorder can only wait for a failed board to recover.
    pub reset_line: bool,
    /// How long the board may go without a heartbeat.
    pub heartbeat_timeout_ms: u32,
    /// Reference address that the board tells devices that ask. It means nothing to the recorder.
    pub reference: u16,
}

impl GeniusOptions {
    /// A board that is reset at power-up and whenever it fails.
    #[must_use]
    pub const fn new(model: Model) -> GeniusOptions {
        GeniusOptions {
            model,
            start: Start::Reset { hold_ms: timing::POWER_UP_RESET_MS },
            reset_line: true,
            heartbeat_timeout_ms: timing::HEARTBEAT_TIMEOUT_MS,
            reference: NO_REFERENCE,
        }
    }

    pub(super) fn driver_options(self) -> Options {
        let len = match self.model {
            Model::Ser160 => 2,
            Model::Ser320 => 4,
        };
        // The recorder does not read other devices' inputs, but with shorter buffers the board
        // would not log all devices in.
        let configuration =
            Configuration::new(self.reference, len, 0, Configuration::DEFAULT.buffer_len());
        Options {
            start: self.start,
            reset_line: self.reset_line,
            heartbeat_timeout_ms: self.heartbeat_timeout_ms,
            // A pulse of the line then always means a datagram. All else can wait until the flags
            // are polled.
            interrupts: Interrupts::RECEIVE_QUEUE,
            ..Options::new(configuration.unwrap_or(Configuration::DEFAULT))
        }
    }
}

impl Default for GeniusOptions {
    /// Options for the 16-input model.
    fn default() -> GeniusOptions {
        GeniusOptions::new(Model::Ser160)
    }
}
