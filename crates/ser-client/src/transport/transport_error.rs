//! The ways in which a line fails in the middle of a conversation.

use std::error::Error;
use std::fmt;
use std::io::{self, ErrorKind};

use super::genius_error::GeniusError;

/// The way in which a line failed in the middle of a conversation.
#[derive(Debug)]
pub enum TransportError {
    /// The serial device is gone.
    Unplugged,
    /// The other end of the connection went away.
    Closed,
    /// It did so before the first answer.
    TurnedAway {
        /// The text that it sent instead, on one line; empty if it said nothing.
        said: String,
    },
    /// The GENI board or the bus behind it failed.
    Genius(GeniusError),
    /// Anything else.
    Io(io::Error),
}

impl TransportError {
    /// What a person can try next, if there is something to say.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        match self {
            TransportError::Unplugged => {
                Some("plug the adapter in again; its name may have changed")
            }
            TransportError::Closed => {
                Some("is the program or the terminal server at the other end still running?")
            }
            TransportError::TurnedAway { .. } => Some(
                "perhaps another client has the recorder: most terminal servers serve one at a time",
            ),
            TransportError::Genius(error) => Some(error.hint()),
            TransportError::Io(_) => None,
        }
    }
}

impl TransportError {
    /// Whether a message that could not be sent for this reason cannot have left this host.
    pub(crate) const fn is_before_sending(&self) -> bool {
        matches!(
            self,
            TransportError::Genius(GeniusError::NotOnBus { .. } | GeniusError::OwnNumber { .. })
        )
    }
}

impl From<GeniusError> for TransportError {
    fn from(error: GeniusError) -> TransportError {
        TransportError::Genius(error)
    }
}

impl From<io::Error> for TransportError {
    fn from(error: io::Error) -> TransportError {
        match error.kind() {
            ErrorKind::NotConnected => TransportError::Unplugged,
            ErrorKind::ConnectionRefused => {
                let said = error.get_ref().map(ToString::to_string).unwrap_or_default();
                TransportError::TurnedAway { said }
            }
            ErrorKind::UnexpectedEof
            | ErrorKind::BrokenPipe
            | ErrorKind::ConnectionReset
            | ErrorKind::ConnectionAborted => TransportError::Closed,
            _ => TransportError::Io(error),
        }
    }
}

impl fmt::Display for TransportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransportError::Unplugged => write!(f, "the serial port is gone"),
            TransportError::Closed => write!(f, "the connection was closed by the other end"),
            TransportError::TurnedAway { said } => {
                write!(f, "the connection was closed by the other end before the first answer")?;
                if said.is_empty() { Ok(()) } else { write!(f, ", which said: {said}") }
            }
            TransportError::Genius(error) => error.fmt(f),
            TransportError::Io(error) => write!(f, "the line failed: {error}"),
        }
    }
}

impl Error for TransportError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            TransportError::Io(error) => Some(error),
            TransportError::Unplugged
            | TransportError::Closed
            | TransportError::TurnedAway { .. }
            | TransportError::Genius(_) => None,
        }
    }
}
