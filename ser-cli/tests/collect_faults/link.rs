//! A terminal server between a collector and a recorder. Its client may be cut off, and its cable may
//! be pulled out or put into another recorder, with the client none the wiser. It may also make an
//! original recorder of one of ours, by handing over nothing but questions for entries.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ser_proto::{Command, Decoded, FrameDecoder, FrameEncoder};

/// How soon a change is noticed.
const BEAT: Duration = Duration::from_millis(2);

/// How long either side may take nothing before it is given up.
const STUCK: Duration = Duration::from_secs(20);

/// What a link is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wiring {
    /// The recorder at the other end of the cable.
    pub(crate) to: Option<SocketAddr>,
    /// Whether clients are let in.
    pub(crate) is_open: bool,
    /// Whether the recorder is made an original one.
    pub(crate) is_original: bool,
}

/// A link; it ends with the test.
pub(crate) struct Link {
    port: u16,
    wiring: Arc<Mutex<Wiring>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    pub(crate) fn to(recorder: SocketAddr, is_original: bool) -> Link {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        listener.set_nonblocking(true).expect("a socket");
        let port = listener.local_addr().expect("an address").port();
        let wiring =
            Arc::new(Mutex::new(Wiring { to: Some(recorder), is_open: true, is_original }));
        let stop = Arc::new(AtomicBool::new(false));
        let (of_thread, stopped) = (Arc::clone(&wiring), Arc::clone(&stop));
        let thread = thread::spawn(move || {
            let questions = FrameDecoder::new();
            let mut ends = Ends { listener, client: None, recorder: None, questions };
            while !stopped.load(Ordering::Relaxed) {
                let wiring = *locked(&of_thread);
                ends.pass_on(wiring);
            }
        });
        Link { port, wiring, stop, thread: Some(thread) }
    }

    /// As a site file has it.
    pub(crate) fn port(&self) -> String {
        format!("tcp://127.0.0.1:{}", self.port)
    }

    pub(crate) fn wiring(&self) -> Wiring {
        *locked(&self.wiring)
    }

    pub(crate) fn wire(&self, wiring: Wiring) {
        *locked(&self.wiring) = wiring;
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            _ = thread.join();
        }
    }
}

fn locked(wiring: &Mutex<Wiring>) -> MutexGuard<'_, Wiring> {
    wiring.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Both ends of a link.
struct Ends {
    listener: TcpListener,
    client: Option<TcpStream>,
    recorder: Option<(SocketAddr, TcpStream)>,
    /// Finds the questions that an original recorder answers.
    questions: FrameDecoder<168>,
}

impl Ends {
    fn pass_on(&mut self, wiring: Wiring) {
        if !wiring.is_open {
            self.client = None;
        }
        // Who comes later takes the place of one who may be dead.
        if let Ok((stream, _)) = self.listener.accept()
            && wiring.is_open
        {
            self.client = prepared(stream);
        }
        self.recorder.take_if(|(to, _)| wiring.to != Some(*to));
        let Some(client) = &mut self.client else {
            self.recorder = None;
            thread::sleep(BEAT);
            return;
        };
        if let (None, Some(to)) = (&self.recorder, wiring.to) {
            let stream = TcpStream::connect_timeout(&to, STUCK).ok().and_then(prepared);
            self.recorder = stream.map(|stream| (to, stream));
        }
        let recorder = self.recorder.as_mut().map(|(_, stream)| stream);
        let has_client = carry(client, recorder, wiring.is_original.then_some(&mut self.questions));
        if let Some((_, recorder)) = &mut self.recorder
            && !carry(recorder, Some(client), None)
        {
            self.recorder = None;
        }
        if !has_client {
            self.client = None;
        }
    }
}

fn prepared(stream: TcpStream) -> Option<TcpStream> {
    let is_ready = stream
        .set_nonblocking(false)
        .and_then(|()| stream.set_nodelay(true))
        .and_then(|()| stream.set_read_timeout(Some(BEAT)))
        .and_then(|()| stream.set_write_timeout(Some(STUCK)));
    is_ready.ok().map(|()| stream)
}

/// Carries what one end has said to the other, or drops it where no cable is plugged in. Returns
/// whether the end is still there.
fn carry(
    from: &mut TcpStream,
    to: Option<&mut TcpStream>,
    questions: Option<&mut FrameDecoder<168>>,
) -> bool {
    let mut bytes = [0; 4096];
    match from.read(&mut bytes) {
        Ok(0) => false,
        Ok(count) => {
            let bytes = match questions {
                Some(questions) => for_entries(questions, &bytes[..count]),
                None => bytes[..count].to_vec(),
            };
            // An end that takes nothing is noticed when it is read.
            _ = to.map(|to| to.write_all(&bytes));
            true
        }
        Err(error) => matches!(
            error.kind(),
            ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
        ),
    }
}

/// The questions for entries among what a client says.
fn for_entries(questions: &mut FrameDecoder<168>, said: &[u8]) -> Vec<u8> {
    let mut passed = Vec::new();
    for &byte in said {
        if let Some(Decoded::Frame(body)) = questions.push(byte)
            && let Ok(command @ Command::Read { .. }) = Command::parse(body)
        {
            passed.extend(FrameEncoder::new(command.to_body()));
        }
    }
    passed
}
