//! A host at the far end of the line, made of plain reads and writes.
#![allow(dead_code, reason = "every test program uses its own part")]

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use ser_proto::{Command, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, Reply};

/// Far longer than anything here takes. Only a test that fails waits for it.
pub(crate) const LONG: Duration = Duration::from_secs(20);

/// Waits until `condition` gives something.
pub(crate) fn wait_for<T>(what: &str, mut condition: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = condition() {
            return found;
        }
        assert!(began.elapsed() < LONG, "waited in vain: {what}");
        // Gives the processor to those who are waited for.
        thread::park_timeout(Duration::from_millis(1));
    }
}

/// The bytes of a command on the line.
pub(crate) fn frame(command: &Command) -> Vec<u8> {
    FrameEncoder::new(command.to_body()).collect()
}

/// A host on a pseudo-terminal.
pub(crate) struct Terminal(pub(crate) File);

impl Terminal {
    pub(crate) fn open(path: impl AsRef<Path>, bits_per_second: u32) -> Terminal {
        let flags = i32::try_from((OFlags::NOCTTY | OFlags::NONBLOCK).bits()).unwrap();
        let file = {
            use std::os::unix::fs::OpenOptionsExt;
            OpenOptions::new().read(true).write(true).custom_flags(flags).open(path).unwrap()
        };
        let mut settings = tcgetattr(&file).unwrap();
        settings.make_raw();
        settings.set_speed(bits_per_second).unwrap();
        tcsetattr(&file, OptionalActions::Now, &settings).unwrap();
        Terminal(file)
    }

    pub(crate) fn set_rate(&self, bits_per_second: u32) {
        let mut settings = tcgetattr(&self.0).unwrap();
        settings.set_speed(bits_per_second).unwrap();
        tcsetattr(&self.0, OptionalActions::Now, &settings).unwrap();
    }

    pub(crate) fn send(&mut self, command: &Command) {
        self.0.write_all(&frame(command)).unwrap();
    }

    /// Sends a command and waits for the reply to it. Other messages are skipped.
    pub(crate) fn ask(&mut self, command: &Command) -> Reply {
        self.send(command);
        let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
        loop {
            for byte in self.read() {
                if let Some(Decoded::Frame(body)) = decoder.push(byte) {
                    let reply = Reply::parse(body).unwrap();
                    if reply.code() == command.code() {
                        return reply;
                    }
                }
            }
        }
    }

    /// Waits for bytes.
    pub(crate) fn read(&mut self) -> Vec<u8> {
        self.read_within(LONG).expect("bytes from the node")
    }

    /// Waits for bytes, at most for `timeout`.
    pub(crate) fn read_within(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        let timeout = Timespec::try_from(timeout).unwrap();
        let ready = poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&timeout)).unwrap();
        if ready == 0 {
            return None;
        }
        let mut buffer = [0; 256];
        let read = self.0.read(&mut buffer).unwrap();
        Some(buffer[..read].to_vec())
    }
}

/// A host on TCP. `port` is what [`Simulator::port`](ser_sim::Simulator::port) returns.
pub(crate) fn connect(port: &str) -> TcpStream {
    let stream = TcpStream::connect(port.strip_prefix("tcp://").unwrap()).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream
}

/// Sends a command and waits for a reply; `None` when the connection is closed instead.
pub(crate) fn ask(stream: &mut TcpStream, command: &Command) -> Option<Reply> {
    let closed = |kind| matches!(kind, ErrorKind::ConnectionReset | ErrorKind::BrokenPipe);
    match stream.write_all(&frame(command)) {
        Err(error) if closed(error.kind()) => return None,
        written => written.unwrap(),
    }
    let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
    let mut byte = [0];
    loop {
        match stream.read(&mut byte) {
            Ok(0) => return None,
            Err(error) if closed(error.kind()) => return None,
            read => read.unwrap(),
        };
        if let Some(Decoded::Frame(body)) = decoder.push(byte[0]) {
            return Some(Reply::parse(body).unwrap());
        }
    }
}
