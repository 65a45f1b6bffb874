//! A command as a port hands it to the recorder: what it says, when it arrived, and the way back.

use ser_proto::{Command, ParseError};

use crate::tick_stamp::TickStamp;

/// The way on which a command came, and on which its reply goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Way {
    /// The RS-232 line.
    Line,
    /// The Genius bus, from the device with this bus address.
    Bus(u8),
    /// The Genius bus, to all recorders. It gets no reply.
    Broadcast,
}

/// A command, or what was sent as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Arrival {
    pub(crate) command: Result<Command, ParseError>,
    /// The moment of arrival, to the tick on the bus. That of reading where nobody saw the arrival.
    pub(crate) at: TickStamp,
    pub(crate) is_seen: bool,
    pub(crate) way: Way,
}
