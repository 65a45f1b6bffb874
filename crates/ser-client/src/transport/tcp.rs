//! A TCP connection: a terminal server in front of the serial line, or a simulated recorder.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use ser_proto::ESC;

use super::open_error::OpenError;
use super::{Transport, bytes_read};

/// Applies to each address of the host.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A peer that takes nothing for this long has gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// So much of what the other end says before the first frame is shown.
const MAX_GREETING_LEN: usize = 200;

/// An open TCP connection.
#[derive(Debug)]
pub struct TcpTransport {
    stream: TcpStream,
    /// The text that came before the first frame, as far as it is shown; nothing from then on.
    greeting: Option<Vec<u8>>,
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
                Ok(stream) => return Ok(TcpTransport { stream, greeting: Some(Vec::new()) }),
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
    /// Keeps what the other end says before the first frame: it may say why it goes.
    fn listen(&mut self, bytes: &[u8]) {
        if bytes.contains(&ESC) {
            self.greeting = None;
        }
        if let Some(greeting) = &mut self.greeting {
            let room = MAX_GREETING_LEN.saturating_sub(greeting.len());
            greeting.extend(bytes.iter().take(room));
        }
    }

    /// An end before the first frame has another cause than one in the middle of a conversation.
    fn ended(&self, error: io::Error) -> io::Error {
        let is_end = matches!(
            error.kind(),
            ErrorKind::UnexpectedEof
                | ErrorKind::BrokenPipe
                | ErrorKind::ConnectionReset
                | ErrorKind::ConnectionAborted
        );
        match &self.greeting {
            Some(greeting) if is_end => {
                let said = String::from_utf8_lossy(greeting);
                let words: Vec<&str> = said.split_whitespace().collect();
                match words.is_empty() {
                    true => ErrorKind::ConnectionRefused.into(),
                    false => io::Error::new(ErrorKind::ConnectionRefused, words.join(" ")),
                }
            }
            _ => error,
        }
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
        if let Some(bytes) = read.as_ref().ok().and_then(|&read| buf.get(..read)) {
            self.listen(bytes);
        }
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
