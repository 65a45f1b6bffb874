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
    /// The board works but is not on the bus.
    OffBus,
    /// No device with this bus address is logged in.
    NotOnBus {
        /// The bus address.
        node: u8,
    },
    /// The bus address is that of this host's own board.
    OwnNumber {
        /// The bus address.
        node: u8,
    },
    /// The board did not handle a datagram in time.
    BoardBusy,
    /// A datagram to a device did not get through, or was not answered.
    Undelivered(CommandError),
    /// A broadcast was not sent. No device acknowledges one, so it was this host's own board that
    /// could not send it.
    BroadcastFailed(CommandError),
    /// A device's answer does not belong to the question.
    OddReply {
        /// Its bus address.
        node: u8,
    },
    /// The window can no longer be read or written.
    Window(io::ErrorKind),
    /// The caller set `stop` while the board was being waited for.
    Interrupted,
}

impl GeniusError {
    /// Whether waiting may help: the driver starts its board again and again, and devices come
    /// back.
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
                 has this bus address"
            }
            GeniusError::NotOnBus { .. } => {
                "check bus address and bus rate on the device's switches"
            }
            GeniusError::OwnNumber { .. } => {
                "give the bus address of the recorder, not that of the host"
            }
            GeniusError::BoardBusy => "try again; does another program use the same window?",
            GeniusError::Undelivered(_) => {
                "try again; if it persists, look for errors on the bus: cable, terminators, a \
                 bus address that is used twice"
            }
            GeniusError::BroadcastFailed(_) => {
                "try again in a minute: after a start on a large bus the board is busy with \
                 itself for that long"
            }
            GeniusError::OddReply { .. } => "does this kind of device know the question?",
            GeniusError::Window(_) => "is the file still there, and has it kept its length?",
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
            GeniusError::BoardBusy => f.write_str("the GENI board does not handle the datagram"),
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
            GeniusError::Interrupted => f.write_str("interrupted while waiting for the GENI board"),
        }
    }
}

impl Error for GeniusError {}
