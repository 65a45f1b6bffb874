//! A serial line over TCP, for one client at a time.
//!
//! A second client is told who has the line, and its connection is closed. A client that leaves
//! makes room for the next. A slow client slows down what the recorder sends and nothing else.
//!
//! # Design
//! No client can block the line for ever. A client whose computer is gone, or cannot be reached any
//! more, does not answer the probes of TCP and is given up within two minutes. A client that is
//! there and says nothing may be listening, and may do so as long as it likes. If it has been
//! silent for ten minutes and another client comes, it gives way.

use std::io::{self, ErrorKind, Read, Write};
use std::mem;
use std::net::{
    IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, ToSocketAddrs,
};
#[cfg(unix)]
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use super::Line;
use crate::error::SimError;

/// How long a client that has closed its sending side may wait for answers.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// How soon TCP asks a silent client whether it is there, and how often if it does not answer.
#[cfg(unix)]
const PROBE_AFTER: Duration = Duration::from_secs(60);
#[cfg(unix)]
const PROBE_EVERY: Duration = Duration::from_secs(10);
#[cfg(unix)]
const PROBES: u32 = 6;

pub(crate) struct TcpLine {
    listener: TcpListener,
    address: SocketAddr,
    gives_way_after: Option<Duration>,
    client: Option<Client>,
    /// A connection that came while there was a client. The next read shows whether that client is
    /// gone.
    candidate: Option<(TcpStream, SocketAddr)>,
    client_changed: bool,
    notices: Vec<String>,
}

struct Client {
    stream: TcpStream,
    address: SocketAddr,
    /// When the client last sent something, or connected.
    heard: Instant,
    /// Whether the user was told that others want its place. Once is enough.
    has_turned_away: bool,
    /// When the client closed its sending side. `nc` does so at the end of its input and still
    /// listens.
    last_word: Option<Instant>,
}

impl TcpLine {
    /// Listens; see [`Port::Tcp`](crate::Port::Tcp).
    pub(crate) fn listen(
        address: &str,
        gives_way_after: Option<Duration>,
    ) -> Result<TcpLine, SimError> {
        let found = address.to_socket_addrs();
        let addresses: Vec<SocketAddr> =
            found.map_err(|_| SimError::NoSuchHost(address.to_owned()))?.collect();
        let listen = || {
            let listener = TcpListener::bind(&addresses[..])?;
            listener.set_nonblocking(true)?;
            let address = listener.local_addr()?;
            Ok((listener, address))
        };
        let (listener, address) = listen().map_err(SimError::io(format!("listen on {address}")))?;
        Ok(TcpLine {
            listener,
            address,
            gives_way_after,
            client: None,
            candidate: None,
            client_changed: false,
            notices: Vec::new(),
        })
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
            Ok(read) => {
                client.heard = Instant::now();
                return Some(read);
            }
            Err(error) if is_temporary(&error) => {}
            Err(_) => self.client = None,
        }
        None
    }

    /// Lets the candidate in, or turns it away.
    fn decide(&mut self) -> io::Result<()> {
        let Some((stream, address)) = self.candidate.take() else { return Ok(()) };
        if let Some(client) = self.client.as_mut().filter(|client| client.last_word.is_none()) {
            let silent = client.heard.elapsed();
            if self.gives_way_after.is_none_or(|patience| silent < patience) {
                if !mem::replace(&mut client.has_turned_away, true) {
                    let has = format!("{address} was turned away: {} has the line", client.address);
                    self.notices.push(has);
                }
                turn_away(stream, client.address);
                return Ok(());
            }
            let seconds = silent.as_secs();
            self.notices.push(format!(
                "{} has been silent for {seconds} s and gives way to {address}",
                client.address
            ));
        }
        prepare(&stream)?;
        let heard = Instant::now();
        self.client =
            Some(Client { stream, address, heard, has_turned_away: false, last_word: None });
        self.client_changed = true;
        Ok(())
    }
}

/// Says why in a line of text, which is no frame, and closes the connection. A client that has gone
/// meanwhile is told nothing.
fn turn_away(mut stream: TcpStream, holder: SocketAddr) {
    let told = stream
        .set_nonblocking(true)
        .and_then(|()| write!(stream, "busy: {holder} has the line\r\n"))
        .and_then(|()| stream.shutdown(Shutdown::Write));
    // Unread bytes would reset the connection, and with it what it was told.
    if told.is_ok() {
        let _ = stream.read(&mut [0; 1024]);
    }
}

fn prepare(stream: &TcpStream) -> io::Result<()> {
    stream.set_nonblocking(true)?;
    // Answers are short, and a host waits for each.
    stream.set_nodelay(true)?;
    // Without probes it is only noticed later that a client is gone.
    #[cfg(unix)]
    let _ = probe(stream);
    Ok(())
}

/// Has TCP ask whether a silent client is still there, and give up one that is not.
#[cfg(unix)]
fn probe(stream: &TcpStream) -> rustix::io::Result<()> {
    use rustix::net::sockopt;
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, PROBE_AFTER)?;
    sockopt::set_tcp_keepintvl(stream, PROBE_EVERY)?;
    sockopt::set_tcp_keepcnt(stream, PROBES)?;
    // Linux sends no probes while something sent to the client is not acknowledged.
    #[cfg(target_os = "linux")]
    {
        let given_up = PROBE_AFTER + PROBE_EVERY * PROBES;
        sockopt::set_tcp_user_timeout(
            stream,
            u32::try_from(given_up.as_millis()).unwrap_or(u32::MAX),
        )?;
    }
    Ok(())
}

impl Line for TcpLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(received) = self.read_client(buffer) {
            return Ok(received);
        }
        // A candidate that cannot be set up has left again.
        let _ = self.decide();
        // The same is true of one that cannot be accepted.
        self.candidate = self.listener.accept().ok();
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
        mem::take(&mut self.client_changed)
    }

    fn take_notices(&mut self) -> Vec<String> {
        mem::take(&mut self.notices)
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

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use rustix::net::sockopt;

    use super::*;

    #[test]
    fn a_client_that_is_gone_is_given_up_within_two_minutes() {
        let mut line = TcpLine::listen("127.0.0.1:0", None).unwrap();
        let _host = TcpStream::connect(line.address).unwrap();
        while line.client.is_none() {
            assert_eq!(line.read(&mut [0; 8]).unwrap(), 0);
        }
        let stream = &line.client.as_ref().unwrap().stream;
        assert!(sockopt::socket_keepalive(stream).unwrap());
        let probing =
            sockopt::tcp_keepintvl(stream).unwrap() * sockopt::tcp_keepcnt(stream).unwrap();
        let within = Duration::from_secs(120);
        assert!(sockopt::tcp_keepidle(stream).unwrap() + probing <= within);
        let unacknowledged = sockopt::tcp_user_timeout(stream).unwrap();
        assert!((1..=within.as_millis()).contains(&unacknowledged.into()));
    }
}
