//! How bytes get to a unit and back.

use std::error::Error;
use std::io;
use std::time::Duration;
use std::{fmt, io::ErrorKind};

use crate::GeniusError;

/// A line to a unit, blocking.
pub trait Transport: Send {
    /// Waits up to `timeout` for bytes and takes those that are there. 0 means that none came in time.
    ///
    /// # Errors
    /// A line that has ended is an error, never 0: `NotConnected` for a device that was unplugged,
    /// `UnexpectedEof` or one of the connection kinds for a peer that went away;
    /// `ConnectionRefused` if it has not said anything before.
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Sends all bytes; they may still be on the line when this returns.
    ///
    /// # Errors
    /// As for [`read`](Self::read).
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Changes the rate of the line. A line without a rate does nothing.
    ///
    /// # Errors
    /// If the port does not have this rate.
    fn set_baud(&mut self, bits_per_second: u32) -> io::Result<()>;

    /// The rate of the line, if it has one.
    fn bits_per_second(&self) -> Option<u32>;
}

/// What a blocking read came to: none in time is no error here, and the end of the line, of which `read` makes no
/// error, is one of kind `ended`.
pub(crate) fn bytes_read(read: io::Result<usize>, wanted: usize, ended: ErrorKind) -> io::Result<usize> {
    match read {
        Ok(0) if wanted > 0 => Err(ended.into()),
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
            ) =>
        {
            Ok(0)
        }
        read => read,
    }
}

/// How a line failed in the middle of a conversation.
#[derive(Debug)]
pub enum TransportError {
    /// The serial device is gone.
    Unplugged,
    /// The other end of the connection went away.
    Closed,
    /// It did so before it said anything.
    TurnedAway,
    /// The GENI board, or the bus behind it.
    Genius(GeniusError),
    /// Anything else.
    Io(io::Error),
}

impl TransportError {
    /// What a person can try next, if there is something to say.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        match self {
            TransportError::Unplugged => Some("plug the adapter in again; its name may have changed"),
            TransportError::Closed => {
                Some("is the program or the terminal server at the other end still running?")
            }
            TransportError::TurnedAway => {
                Some("perhaps another client has the unit: most terminal servers serve one at a time")
            }
            TransportError::Genius(error) => Some(error.hint()),
            TransportError::Io(_) => None,
        }
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
            ErrorKind::ConnectionRefused => TransportError::TurnedAway,
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
            TransportError::TurnedAway => {
                write!(f, "the connection was closed by the other end before the first answer")
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
            | TransportError::TurnedAway
            | TransportError::Genius(_) => None,
        }
    }
}
