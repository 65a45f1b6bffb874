//! How bytes get to a recorder and back: over a serial port or TCP, both a [`Transport`].
//!
//! Everything that depends on this computer is here: how a port is named, listed and opened, how
//! time passes, and what can go wrong. The meaning of the bytes is in `session`.

pub(crate) mod clock;
pub(crate) mod endpoint;
pub(crate) mod genius_error;
pub(crate) mod host_time;
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
    /// Waits up to `timeout` for bytes and takes those that have come. 0 means that none came in
    /// time.
    ///
    /// # Errors
    /// A line that has ended is an error, never 0. The kind is `NotConnected` for a device that was
    /// unplugged, and `UnexpectedEof` or a connection kind for a peer that went away. It is
    /// `ConnectionRefused` for a peer that had not sent anything before.
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Sends all bytes; they may still be on the line when the call returns.
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

    /// Whether bytes take as long as the rate says. Some ports have a rate only for the sake of
    /// programs that set one.
    fn keeps_rate(&self) -> bool {
        true
    }
}

/// The outcome of a blocking read. A read without bytes in time is not an error here. The end of
/// the line, which `read` reports as 0 bytes, is an error of kind `ended`.
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
