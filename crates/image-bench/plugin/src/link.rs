//! The socket to the bench.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// How many bytes go out at once.
const PORTION: usize = 1 << 16;

/// The bench's byte that asks for every instruction.
const TELL_ALL: u8 = b't';

pub(crate) struct Link {
    stops: Vec<u64>,
    telling: AtomicBool,
    stream: Mutex<Stream>,
}

struct Stream {
    socket: UnixStream,
    words: Vec<u8>,
}

impl Link {
    /// Connects to the bench as the options say.
    pub(crate) fn open(options: impl Iterator<Item = impl AsRef<str>>) -> Result<Link, String> {
        let (mut socket, mut stops) = (None, Vec::new());
        for option in options {
            let option = option.as_ref();
            match option.split_once('=') {
                Some(("socket", path)) => {
                    let connected = UnixStream::connect(path);
                    socket = Some(
                        connected.map_err(|error| format!("cannot connect to {path}: {error}"))?,
                    );
                }
                Some(("stop", address)) => {
                    let address = u64::from_str_radix(address, 16);
                    stops.push(address.map_err(|_| format!("{option} does not name an address"))?);
                }
                _ => return Err(format!("{option} is not an option")),
            }
        }
        let socket = socket.ok_or("the option socket=PATH is missing")?;
        let stream = Stream { socket, words: Vec::with_capacity(PORTION) };
        Ok(Link { stops, telling: AtomicBool::new(false), stream: Mutex::new(stream) })
    }

    pub(crate) fn stops_at(&self, address: u64) -> bool {
        self.stops.contains(&address)
    }

    /// Tells the bench of an instruction, if it wants to know.
    pub(crate) fn executed(&self, address: usize) {
        if self.telling.load(Ordering::Relaxed) {
            self.with_stream(|stream| {
                stream.push(address);
                if stream.words.len() >= PORTION { stream.flush() } else { Ok(()) }
            });
        }
    }

    /// Waits for the bench.
    pub(crate) fn stopped(&self, address: usize) {
        self.with_stream(|stream| {
            stream.push(address | 1);
            stream.flush()?;
            let mut answer = [0];
            stream.socket.read_exact(&mut answer)?;
            self.telling.store(answer == [TELL_ALL], Ordering::Relaxed);
            Ok(())
        });
    }

    fn with_stream(&self, what: impl FnOnce(&mut Stream) -> std::io::Result<()>) {
        let mut stream = self.stream.lock().unwrap_or_else(PoisonError::into_inner);
        if what(&mut stream).is_err() {
            // The bench is gone, and nobody else waits for this emulator.
            process::abort();
        }
    }
}

impl Stream {
    fn push(&mut self, address: usize) {
        // The processor has 32 bits.
        let [a, b, c, d, ..] = address.to_le_bytes();
        self.words.extend([a, b, c, d]);
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.socket.write_all(&self.words)?;
        self.words.clear();
        Ok(())
    }
}
