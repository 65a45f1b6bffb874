//! A serial line over TCP, for one client at a time.
//!
//! A second client is closed at once, so that it notices; a client that goes makes room for the next.
//! A slow client slows down what the node sends and nothing else.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream};
#[cfg(unix)]
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use crate::error::SimError;
use crate::line::Line;

/// How long a client that has said its last word may wait for answers.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

pub(crate) struct TcpLine {
    listener: TcpListener,
    address: SocketAddr,
    client: Option<Client>,
    /// A connection that came while there was a client. Whether that client is gone shows when it is read next.
    candidate: Option<TcpStream>,
    client_changed: bool,
}

struct Client {
    stream: TcpStream,
    /// When it closed its sending side: `nc` does so at the end of its input and still listens.
    last_word: Option<Instant>,
}

impl TcpLine {
    pub(crate) fn listen(address: &str) -> Result<TcpLine, SimError> {
        let listen = || {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) = listen().map_err(SimError::io(format!("listen on {address}")))?;
        Ok(TcpLine { listener, address, client: None, candidate: None, client_changed: false })
    }

    /// Reads from the client; `None` when it is there and silent.
    fn read_client(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let client = self.client.as_mut()?;
        if let Some(since) = client.last_word {
            if since.elapsed() > LAST_ANSWERS {
                self.client = None;
            }
            return None;
        }
        match client.stream.read(buffer) {
            Ok(0) => client.last_word = Some(Instant::now()),
            Ok(read) => return Some(read),
            Err(error) if is_temporary(&error) => {}
            Err(_) => self.client = None,
        }
        None
    }

    /// Lets the candidate in, or turns it away.
    fn decide(&mut self) -> io::Result<()> {
        let Some(stream) = self.candidate.take() else { return Ok(()) };
        if self.client.as_ref().is_none_or(|client| client.last_word.is_some()) {
            stream.set_nonblocking(true)?;
            // Answers are short and a host waits for each.
            stream.set_nodelay(true)?;
            self.client = Some(Client { stream, last_word: None });
            self.client_changed = true;
        }
        Ok(())
    }
}

impl Line for TcpLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(received) = self.read_client(buffer) {
            return Ok(received);
        }
        // A candidate that cannot be set up has gone again.
        let _ = self.decide();
        // So has one that cannot be accepted.
        self.candidate = self.listener.accept().ok().map(|(stream, _)| stream);
        Ok(0)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(client) = &mut self.client else { return Ok(bytes.len()) };
        match client.stream.write(bytes) {
            Ok(written) => Ok(written),
            Err(error) if is_temporary(&error) => Ok(0),
            Err(_) => {
                self.client = None;
                Ok(bytes.len())
            }
        }
    }

    fn host_bits_per_second(&self) -> Option<u32> {
        None
    }

    fn take_host_change(&mut self) -> bool {
        std::mem::take(&mut self.client_changed)
    }

    fn publish(&mut self) -> Result<(), SimError> {
        Ok(())
    }

    fn name(&self) -> String {
        let mut address = self.address;
        match address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => address.set_ip(Ipv4Addr::LOCALHOST.into()),
            IpAddr::V6(ip) if ip.is_unspecified() => address.set_ip(Ipv6Addr::LOCALHOST.into()),
            _ => {}
        }
        format!("tcp://{address}")
    }

    #[cfg(unix)]
    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        // A client that has said its last word stays readable for ever.
        let client = self.client.iter().filter(|client| client.last_word.is_none());
        client.map(|client| client.stream.as_fd()).chain([self.listener.as_fd()]).collect()
    }
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}
