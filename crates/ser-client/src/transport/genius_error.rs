//! What can go wrong between a host and its GENI board.

use std::error::Error;
use std::{fmt, io};

use geni_board::{CommandError, Failure};

/// Why a host cannot use its GENI board, or a device on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeniusError {
    /// The board in the window gives no sign of life.
    BoardSilent,
    /// The board has failed.
    BoardFailed(Failure),
    /// The board is well and not on the bus.
    OffBus,
    /// No device with this number is logged in.
    NotOnBus {
        /// The number.
        node: u8,
    },
    /// The number is that of this host's own board.
    OwnNumber {
        /// The number.
        node: u8,
    },
    /// The board did not deal with a datagram in time.
    BoardBusy,
    /// A datagram to a device did not get through, or was not answered.
    Undelivered(CommandError),
    /// A broadcast did not get out. Nobody acknowledges one: it is this host's own board that could
    /// not send it.
    BroadcastFailed(CommandError),
    /// A device answers something that does not belong to the question.
    OddReply {
        /// The device.
        node: u8,
    },
    /// The window can no longer be read or written.
    Window(io::ErrorKind),
    /// Whoever opened the window has had enough of waiting for the board.
    Interrupted,
}

impl GeniusError {
    /// Whether this may pass while one waits: the driver starts its board again and again, and
    /// devices come back.
    #[must_use]
    pub const fn may_pass(&self) -> bool {
        match self {
            GeniusError::BoardSilent
            | GeniusError::BoardFailed(_)
            | GeniusError::OffBus
            | GeniusError::NotOnBus { .. }
            | GeniusError::BoardBusy
            | GeniusError::Undelivered(_)
            | GeniusError::BroadcastFailed(_) => true,
            GeniusError::OwnNumber { .. }
            | GeniusError::OddReply { .. }
            | GeniusError::Window(_)
            | GeniusError::Interrupted => false,
        }
    }

    /// What a person can try next.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            GeniusError::BoardSilent => {
                "is this the window of a GENI board? Then reset the board, or start the simulator"
            }
            GeniusError::BoardFailed(_) => {
                "try again in a few seconds; if it persists, reset the board and look at its lamps"
            }
            GeniusError::OffBus => {
                "check the bus cable and its terminators, the bus rate, and that no other device \
                 has this number"
            }
            GeniusError::NotOnBus { .. } => "check number and bus rate on the device's switches",
            GeniusError::OwnNumber { .. } => {
                "name the number of the recorder, not that of the host"
            }
            GeniusError::BoardBusy => "try again; does another program use the same window?",
            GeniusError::Undelivered(_) => {
                "try again; if it persists, look for errors on the bus: cable, terminators, a \
                 number given twice"
            }
            GeniusError::BroadcastFailed(_) => {
                "try again in a minute: after a start on a large bus the board is busy with \
                 itself for so long"
            }
            GeniusError::OddReply { .. } => "does this kind of device know the question?",
            GeniusError::Window(_) => "is the file still there, and as long as it was?",
            GeniusError::Interrupted => {
                "nothing has been asked of a recorder; give the board some seconds"
            }
        }
    }
}

impl fmt::Display for GeniusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GeniusError::BoardSilent => f.write_str("the GENI board is silent (no heartbeat)"),
            GeniusError::BoardFailed(failure) => failure.fmt(f),
            GeniusError::OffBus => f.write_str("the GENI board is not on the bus"),
            GeniusError::NotOnBus { node } => write!(f, "device {node} is not on the bus"),
            GeniusError::OwnNumber { node } => {
                write!(f, "{node} is the number of this host's own board")
            }
            GeniusError::BoardBusy => f.write_str("the GENI board does not deal with the datagram"),
            GeniusError::Undelivered(error) => error.fmt(f),
            GeniusError::BroadcastFailed(error) => {
                write!(f, "the broadcast did not get out: {error}")
            }
            GeniusError::OddReply { node } => {
                write!(f, "the reply of device {node} makes no sense")
            }
            GeniusError::Window(kind) => {
                write!(f, "the window of the GENI board cannot be used: {kind}")
            }
            GeniusError::Interrupted => {
                f.write_str("interrupted while the GENI board was waited for")
            }
        }
    }
}

impl Error for GeniusError {}
