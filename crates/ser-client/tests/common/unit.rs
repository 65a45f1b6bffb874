//! A recorder behind a transport, without a line in between.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use ser_client::{Clock, Options, Transport, Unit};
use ser_proto::{
    Baud, Command, Configuration, Decoded, FrameDecoder, FrameEncoder, LastBroadcast, Mode,
    ParseError, Reply,
};

use super::Recorder;

const PATIENCE: Options = Options { timeout: Duration::from_millis(1), retries: 2 };

/// What happens to a recorder without the client's knowledge.
type Meanwhile = Box<dyn FnMut(&mut Recorder, &mut Configuration, usize) + Send>;

/// What a recorder makes of a command of our extension.
pub(crate) type Answers = fn(&Command) -> Option<Vec<u8>>;

/// Everything that a test can see and change during the conversation.
pub(crate) struct Fake {
    pub(crate) recorder: Recorder,
    pub(crate) configuration: Configuration,
    /// The rate at which the recorder talks; the client must have the same rate.
    pub(crate) unit_rate: u32,
    pub(crate) line_rate: u32,
    /// Whether the client knows that the line has a rate, and waits accordingly.
    pub(crate) has_rate: bool,
    pub(crate) recording: bool,
    /// How many of the next replies are lost.
    pub(crate) swallow: usize,
    /// Whether the recorder does not know the queries, as original recorders do not.
    pub(crate) original: bool,
    /// The body of its answer to a command that the manual does not have.
    pub(crate) beyond_the_manual: Answers,
    /// Bytes that it says to such a command, whatever they are.
    pub(crate) says_beyond_the_manual: &'static [u8],
    /// Every byte that the client has sent.
    pub(crate) sent: Vec<u8>,
    /// Whether a command is lost while an answer is on the line.
    pub(crate) deaf_when_talking: bool,
    /// After how many more commands the line fails.
    pub(crate) breaks_in: Option<usize>,
    /// The kind of error with which it fails.
    pub(crate) broken: Option<io::ErrorKind>,
    pub(crate) commands: Vec<Command>,
    /// Called after each command with its number.
    pub(crate) meanwhile: Meanwhile,
    /// Bytes under way, with the rate at which they were sent.
    to_client: VecDeque<(u8, u32)>,
    decoder: FrameDecoder<168>,
}

impl Fake {
    pub(crate) fn say(&mut self, bytes: &[u8]) {
        self.to_client.extend(bytes.iter().map(|&byte| (byte, self.unit_rate)));
    }

    pub(crate) fn reply(&mut self, reply: &Reply) {
        self.say(&FrameEncoder::new(reply.to_body()).collect::<Vec<_>>());
    }

    fn hear(&mut self, byte: u8) {
        let command = match self.decoder.push(byte) {
            Some(Decoded::Frame(body)) => Command::parse(body),
            _ => return,
        };
        let command = match command {
            Ok(command) => command,
            Err(ParseError::BadValue { code: 0x43, .. }) => {
                self.reply(&Reply::Configuration(self.configuration));
                return;
            }
            Err(_) => return,
        };
        if self.deaf_when_talking && !self.to_client.is_empty() {
            return;
        }
        self.commands.push(command);
        if let Some(body) = (self.beyond_the_manual)(&command) {
            let sum = body.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte));
            let digits = body.iter().chain([&sum]).map(|byte| format!("{byte:02X}"));
            let frame = format!("\x1B{:02X}{}", body.len(), digits.collect::<String>());
            self.say(frame.as_bytes());
        }
        let mut new_rate = None;
        let reply = match command {
            Command::QueryConfiguration | Command::QueryMode if self.original => None,
            Command::QueryConfiguration => Some(Reply::Configuration(self.configuration)),
            Command::Configure(configure) => {
                self.configuration = configure.apply_to(&self.configuration);
                self.recorder.resize(self.configuration.size.into());
                new_rate = Some(self.configuration.baud.bits_per_second());
                Some(Reply::Configuration(self.configuration))
            }
            Command::Erase => {
                self.recorder.erase();
                Some(Reply::Erased)
            }
            Command::LastBroadcast => Some(Reply::LastBroadcast(Some(LastBroadcast {
                code: 0x45,
                hour: 1,
                minute: 2,
                second: 3,
                millisecond: 4,
            }))),
            Command::QueryMode => {
                Some(Reply::Mode(Mode { recording: self.recording, version: 125 }))
            }
            Command::SetMode { recording } => {
                self.recording = recording;
                Some(Reply::Mode(Mode { recording, version: 125 }))
            }
            Command::Print { .. } => Some(Reply::PrintAccepted),
            Command::Read { start, count } => Some(Reply::Read(self.recorder.read(start, count))),
            Command::SetClock(_) => Some(Reply::ClockSet),
            Command::Identify
            | Command::Time { .. }
            | Command::QueryFilters { .. }
            | Command::SetFilter { .. }
            | Command::Diagnostics { .. } => {
                self.say(self.says_beyond_the_manual);
                None
            }
        };
        if self.swallow > 0 {
            self.swallow -= 1;
        } else if let Some(reply) = reply {
            self.reply(&reply);
        }
        if matches!(command, Command::Print { .. }) {
            self.say(b"1 10:00:00.000 1 ON\r\n");
        }
        if let Some(rate) = new_rate {
            self.unit_rate = rate;
        }
        match &mut self.breaks_in {
            Some(0) => self.broken = Some(io::ErrorKind::NotConnected),
            Some(left) => *left -= 1,
            None => {}
        }
        (self.meanwhile)(&mut self.recorder, &mut self.configuration, self.commands.len());
    }
}

/// Time that passes only while the client waits.
#[derive(Default)]
struct Waited(AtomicU64);

impl Clock for Waited {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed))
    }

    fn wait(&self, time: Duration) {
        let ns = u64::try_from(time.as_nanos()).unwrap();
        self.0.fetch_add(ns, Ordering::Relaxed);
    }
}

/// The client's end, and its time where that is not real.
struct FakeTransport(Arc<Mutex<Fake>>, Option<Arc<Waited>>);

impl Transport for FakeTransport {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut fake = self.0.lock().unwrap();
        if let Some(kind) = fake.broken {
            return Err(kind.into());
        }
        if let Some(time) = self.1.as_ref().filter(|_| fake.to_client.is_empty()) {
            time.wait(timeout);
        }
        let count = buf.len().min(fake.to_client.len());
        let line_rate = fake.line_rate;
        for (to, (byte, rate)) in buf.iter_mut().zip(fake.to_client.drain(..count)) {
            *to = if rate == line_rate { byte } else { byte | 0x80 };
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut fake = self.0.lock().unwrap();
        if let Some(kind) = fake.broken {
            return Err(kind.into());
        }
        fake.sent.extend_from_slice(bytes);
        if fake.line_rate == fake.unit_rate {
            bytes.iter().for_each(|&byte| fake.hear(byte));
        } else {
            fake.say(b"?!");
        }
        Ok(())
    }

    fn set_baud(&mut self, bits_per_second: u32) -> io::Result<()> {
        self.0.lock().unwrap().line_rate = bits_per_second;
        Ok(())
    }

    fn bits_per_second(&self) -> Option<u32> {
        let fake = self.0.lock().unwrap();
        fake.has_rate.then_some(fake.line_rate)
    }
}

/// A client and what it talks to.
pub(crate) struct Bench {
    pub(crate) unit: Unit,
    fake: Arc<Mutex<Fake>>,
}

impl Bench {
    /// A line whose rate the client does not know. What is not answered is given up soon.
    pub(crate) fn new(size: u16) -> Bench {
        Bench::with(size, false)
    }

    /// The same in virtual time, so that nothing that is answered is ever given up.
    pub(crate) fn in_virtual_time(size: u16) -> Bench {
        let Bench { fake, .. } = Bench::new(size);
        let time = Arc::new(Waited::default());
        let end = FakeTransport(Arc::clone(&fake), Some(Arc::clone(&time)));
        Bench { unit: Unit::with_clock(Box::new(end), PATIENCE, time), fake }
    }

    /// Over a line with a rate.
    pub(crate) fn serial(size: u16) -> Bench {
        Bench::with(size, true)
    }

    fn with(size: u16, has_rate: bool) -> Bench {
        let configuration = Configuration { size, baud: Baud::B19200, ..Configuration::default() };
        let fake = Arc::new(Mutex::new(Fake {
            recorder: Recorder::new(size.into()),
            configuration,
            unit_rate: 19_200,
            line_rate: 19_200,
            has_rate,
            recording: true,
            swallow: 0,
            original: false,
            beyond_the_manual: |_| None,
            says_beyond_the_manual: b"",
            sent: Vec::new(),
            deaf_when_talking: false,
            breaks_in: None,
            broken: None,
            commands: Vec::new(),
            meanwhile: Box::new(|_, _, _| {}),
            to_client: VecDeque::new(),
            decoder: FrameDecoder::new(),
        }));
        let end = FakeTransport(Arc::clone(&fake), None);
        Bench { unit: Unit::new(Box::new(end), PATIENCE), fake }
    }

    pub(crate) fn fake(&self) -> MutexGuard<'_, Fake> {
        self.fake.lock().unwrap()
    }
}
