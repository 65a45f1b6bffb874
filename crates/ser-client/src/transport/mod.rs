//! How bytes get to a recorder and back: over a serial port or TCP, both a [`Transport`].
//!
//! Here is everything that knows this computer: how a port is named, listed and opened, how time
//! passes, and what can go wrong on the way. What the bytes mean is known in `session`.

pub(crate) mod clock;
pub(crate) mod endpoint;
pub(crate) mod genius_error;
pub(crate) mod line_rate;
pub(crate) mod open;
pub(crate) mod open_error;
pub(crate) mod ports;
pub(crate) mod serial;
pub(crate) mod tcp;
pub(crate) mod transport_error;

use std::io::{self, ErrorKind};
use std::time::Duration;

/// A line to a recorder, blocking.
pub trait Transport: Send {
    /// Waits up to `timeout` for bytes and takes those that are there. 0 means that none came in
    /// time.
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

/// What a blocking read came to: none in time is no error here, and the end of the line, of which
/// `read` makes no error, is one of kind `ended`.
fn bytes_read(read: io::Result<usize>, wanted: usize, ended: ErrorKind) -> io::Result<usize> {
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
