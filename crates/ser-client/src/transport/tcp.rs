//! A TCP connection: a terminal server in front of the serial line, or a simulated recorder.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::open_error::OpenError;
use super::{Transport, bytes_read};

/// Applies to each address of the host.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A peer that takes nothing for this long has gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// An open TCP connection.
#[derive(Debug)]
pub struct TcpTransport {
    stream: TcpStream,
    /// Whether the other end has sent anything.
    heard: bool,
}

impl TcpTransport {
    /// Connects to `HOST:PORT`. If the host has several addresses, the first one that answers is
    /// used.
    ///
    /// # Errors
    /// See [`OpenError`].
    pub fn connect(address: &str) -> Result<TcpTransport, OpenError> {
        let candidates = address
            .to_socket_addrs()
            .map_err(|_| OpenError::HostNotFound { address: address.to_owned() })?;
        let mut last_error = None;
        for candidate in candidates {
            match TcpStream::connect_timeout(&candidate, CONNECT_TIMEOUT).and_then(prepare) {
                Ok(stream) => return Ok(TcpTransport { stream, heard: false }),
                Err(error) => last_error = Some(error),
            }
        }
        Err(last_error.map_or_else(
            || OpenError::HostNotFound { address: address.to_owned() },
            |error| why_not_connected(address, error),
        ))
    }
}

impl TcpTransport {
    /// An end before the first byte has another cause than one in the middle of a conversation.
    fn ended(&self, error: io::Error) -> io::Error {
        let is_end = matches!(
            error.kind(),
            ErrorKind::UnexpectedEof
                | ErrorKind::BrokenPipe
                | ErrorKind::ConnectionReset
                | ErrorKind::ConnectionAborted
        );
        if is_end && !self.heard { ErrorKind::ConnectionRefused.into() } else { error }
    }
}

fn prepare(stream: TcpStream) -> io::Result<TcpStream> {
    // A request is one small write. Waiting for more to send with it would only delay the answer.
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
    Ok(stream)
}

fn why_not_connected(address: &str, error: io::Error) -> OpenError {
    let address = address.to_owned();
    match error.kind() {
        ErrorKind::ConnectionRefused => OpenError::Refused { address },
        ErrorKind::TimedOut | ErrorKind::HostUnreachable | ErrorKind::NetworkUnreachable => {
            OpenError::Unreachable { address }
        }
        _ => OpenError::Other { name: format!("tcp://{address}"), error },
    }
}

impl Transport for TcpTransport {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        // A socket waits for ever with a timeout of zero, and may round a small one up to several
        // milliseconds.
        self.stream.set_nonblocking(timeout.is_zero())?;
        if !timeout.is_zero() {
            self.stream.set_read_timeout(Some(timeout.max(Duration::from_millis(1))))?;
        }
        let read = self.stream.read(buf);
        let read = bytes_read(read, buf.len(), ErrorKind::UnexpectedEof);
        self.heard |= read.as_ref().is_ok_and(|&read| read > 0);
        read.map_err(|error| self.ended(error))
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.set_nonblocking(false)?;
        self.stream.write_all(bytes).map_err(|error| self.ended(error))
    }

    fn set_baud(&mut self, _: u32) -> io::Result<()> {
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        None
    }
}
