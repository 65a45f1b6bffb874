//! A pseudo-terminal as the serial port: opening, rates, and what happens when it goes away.
#![cfg(target_os = "linux")]

mod common;

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use common::{Recorder, Told, told};
use ser_client::{
    Endpoint, OpenError, Options, RequestError, SerialTransport, Transport, TransportError, Unit,
    Unsolicited, open,
};
use ser_proto::{Baud, Command, Decoded, FrameDecoder, FrameEncoder, Reply};
use serialport::{SerialPort, TTYPort};

/// Far longer than anything here takes on the busiest machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// The recorder's end of a pseudo-terminal, and the name of the client's end.
fn pair() -> (TTYPort, String) {
    let (unit, client) = TTYPort::pair().unwrap();
    let path = client.name().unwrap();
    (unit, path)
}

fn read_at_least(transport: &mut dyn Transport, count: usize) -> Vec<u8> {
    let give_up = Instant::now() + PATIENCE;
    let mut all = Vec::new();
    while all.len() < count && Instant::now() < give_up {
        let mut buf = [0; 64];
        let count = transport.read(&mut buf, Duration::from_millis(50)).unwrap();
        all.extend(&buf[..count]);
    }
    all
}

/// A recorder that answers reads, in a thread, until it is dropped.
struct Answering {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Answering {
    fn start(mut port: TTYPort, recorder: Recorder) -> Answering {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut decoder = FrameDecoder::<168>::new();
            port.set_timeout(Duration::from_millis(20)).unwrap();
            while !stopped.load(Ordering::Relaxed) {
                let mut buf = [0; 64];
                let Ok(count) = port.read(&mut buf) else { continue };
                for &byte in &buf[..count] {
                    let Some(Decoded::Frame(body)) = decoder.push(byte) else { continue };
                    if let Ok(Command::Read { start, count }) = Command::parse(body) {
                        let reply = Reply::Read(recorder.read(start, count));
                        port.write_all(b"a line\r\n").unwrap();
                        port.write_all(&FrameEncoder::new(reply.to_body()).collect::<Vec<_>>())
                            .unwrap();
                    }
                }
            }
        });
        Answering { stop, thread: Some(thread) }
    }
}

impl Drop for Answering {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[test]
fn every_rate_of_the_recorder_can_be_opened_and_set() {
    let (mut unit, path) = pair();
    let mut transport = SerialTransport::open(&path, 300).unwrap();
    for baud in Baud::ALL {
        let rate = baud.bits_per_second();
        transport.set_baud(rate).unwrap();
        assert_eq!(transport.bits_per_second(), Some(rate));
        transport.write_all(b"\x1B014D4D").unwrap();
        let mut heard = [0; 7];
        unit.set_timeout(PATIENCE).unwrap();
        unit.read_exact(&mut heard).unwrap();
        assert_eq!(&heard, b"\x1B014D4D");
        // The terminal must not change anything: no echo, no CR to LF, no XON.
        unit.write_all(b"\r\n\x11\x13\x03\x1B\xFF\x00").unwrap();
        assert_eq!(read_at_least(&mut transport, 8), b"\r\n\x11\x13\x03\x1B\xFF\x00");
    }
    drop(transport);
    for baud in Baud::ALL {
        SerialTransport::open(&path, baud.bits_per_second()).unwrap();
    }
}

#[test]
fn nothing_to_read_is_zero_after_the_timeout() {
    let (_unit, path) = pair();
    let mut transport = SerialTransport::open(&path, 9600).unwrap();
    let before = Instant::now();
    assert_eq!(transport.read(&mut [0; 8], Duration::from_millis(30)).unwrap(), 0);
    assert!(before.elapsed() >= Duration::from_millis(30));
    assert_eq!(transport.read(&mut [0; 8], Duration::ZERO).unwrap(), 0);
}

#[test]
fn what_the_unit_printed_before_is_not_thrown_away() {
    let (mut unit, path) = pair();
    // The terminal keeps bytes only while a program has the port open.
    let transport = SerialTransport::open(&path, 9600).unwrap();
    unit.write_all(b"printed before\r\n").unwrap();
    let mut client = Unit::new(Box::new(transport), Options::default());
    let line = client.wait_event(PATIENCE).unwrap();
    assert!(matches!(line, Some(Unsolicited::Line(line)) if line.text == "printed before"));
}

#[test]
fn a_log_is_read_through_a_terminal() {
    let (port, path) = pair();
    let mut recorder = Recorder::new(40);
    recorder.append_many(55);
    let unit = Answering::start(port, recorder);
    let transport = open(&Endpoint::Serial { path }, 19_200).unwrap();
    let mut client = Unit::new(transport, Options::default());
    let mut all = Vec::new();
    client.read_new(&mut None, 40, &mut |delivery| all.push(told(delivery))).unwrap();
    assert_eq!(all[0], Told::AtLeast(15));
    assert_eq!(all[1..], (16..=55).map(Told::Event).collect::<Vec<_>>());
    assert!(matches!(client.wait_event(PATIENCE).unwrap(), Some(Unsolicited::Line(_))));
    drop(unit);
}

#[test]
fn a_terminal_that_goes_away_is_an_unplugged_port() {
    let (unit, path) = pair();
    let mut client =
        Unit::new(Box::new(SerialTransport::open(&path, 9600).unwrap()), Options::default());
    drop(unit);
    let error = client.log_position().unwrap_err();
    assert!(matches!(error, RequestError::Transport(TransportError::Unplugged)), "{error:?}");
}

#[test]
fn a_port_is_opened_by_one_program_at_a_time() {
    let (_unit, path) = pair();
    let first = SerialTransport::open(&path, 9600).unwrap();
    let second = SerialTransport::open(&path, 9600).map(drop);
    assert!(matches!(&second, Err(OpenError::Busy { path: busy }) if *busy == path), "{second:?}");
    drop(first);
    SerialTransport::open(&path, 9600).unwrap();
}

#[test]
fn what_is_no_serial_port_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("not-a-port");
    std::fs::write(&file, "").unwrap();
    let why = |path: &str| SerialTransport::open(path, 9600).map(drop).unwrap_err();
    let missing = folder.path().join("ttyNONE");
    assert!(matches!(why(missing.to_str().unwrap()), OpenError::NoSuchPort { .. }));
    for path in [file.to_str().unwrap(), folder.path().to_str().unwrap(), "/dev/null"] {
        let error = why(path);
        assert!(matches!(error, OpenError::NotSerial { .. }), "{path}: {error:?}");
        assert!(error.to_string().contains(path));
        assert!(!error.hint().is_empty());
    }
    let (_unit, path) = pair();
    assert!(matches!(
        SerialTransport::open(&path, 0),
        Err(OpenError::UnsupportedBaud { baud: 0, .. })
    ));
}
