//! An original recorder behind a terminal server: it answers reads, and stays silent to everything
//! that only our recorders know.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use ser_proto::{
    Command, Decoded, ESC, Entry, FrameDecoder, FrameEncoder, Inputs, Model, ReadReply, Reply,
    TimeStamp,
};

/// An original recorder with three events.
pub(crate) struct Original {
    port: u16,
    heard: Arc<Mutex<Vec<u8>>>,
}

impl Original {
    pub(crate) fn start() -> Original {
        Original::answering(|body| match Command::parse(body) {
            Ok(Command::Read { start, count }) => {
                Some(FrameEncoder::new(read(start, count.into()).to_body()).collect())
            }
            _ => None,
        })
    }

    /// One of ours that answers neither `T` nor `F`, although it says that it does, and has counted
    /// to 7.
    pub(crate) fn that_says_who_it_is() -> Original {
        Original::answering(|body| match (body, Command::parse(body)) {
            (_, Ok(Command::Read { start, count })) => {
                Some(FrameEncoder::new(read(start, count.into()).to_body()).collect())
            }
            ([b'M'], _) => Some(frame(&[b'M', 1, 100])),
            ([b'C'], _) => Some(frame(&[b'C', 8, 0, 6, 1, 0, 0])),
            ([b'I'], _) => {
                let mut identity = [0; 33];
                identity[..6].copy_from_slice(&[b'I', 1, 16, 1, 2, 3]);
                (identity[9], identity[25], identity[29], identity[30]) = (0b1111, 1, 1, 8);
                Some(frame(&identity))
            }
            ([b'D', 1], _) => Some(frame(&[b'D', 1, 0, 1, 0, 0, 0, 7])),
            ([b'D', first], _) => Some(frame(&[b'D', *first, 0, 0])),
            _ => None,
        })
    }

    /// One that answers reads and, whatever settings it is told, with its own.
    pub(crate) fn that_keeps_its_settings() -> Original {
        Original::answering(|body| match (body, Command::parse(body)) {
            (_, Ok(Command::Read { start, count })) => {
                Some(FrameEncoder::new(read(start, count.into()).to_body()).collect())
            }
            ([b'C', ..], _) => Some(frame(&[b'C', 8, 0, 6, 1, 0, 0])),
            _ => None,
        })
    }

    fn answering(answer: fn(&[u8]) -> Option<Vec<u8>>) -> Original {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let heard = Arc::new(Mutex::new(Vec::new()));
        let codes = Arc::clone(&heard);
        thread::spawn(move || {
            for mut stream in listener.incoming().flatten() {
                let mut decoder = FrameDecoder::<168>::new();
                let mut byte = [0];
                while stream.read_exact(&mut byte).is_ok() {
                    let Some(Decoded::Frame(body)) = decoder.push(byte[0]) else { continue };
                    let code = body.first().copied().unwrap_or_default();
                    codes.lock().unwrap_or_else(PoisonError::into_inner).push(code);
                    if let Some(frame) = answer(body) {
                        let _ = stream.write_all(&frame);
                    }
                }
            }
        });
        Original { port, heard }
    }

    pub(crate) fn port(&self) -> String {
        format!("tcp://127.0.0.1:{}", self.port)
    }

    /// The command bytes that came, in their order.
    pub(crate) fn heard(&self) -> String {
        let heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.iter().map(|&code| char::from(code)).collect()
    }
}

/// A body in its frame.
fn frame(body: &[u8]) -> Vec<u8> {
    let sum = body.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
    let len = u8::try_from(body.len()).expect("a short body");
    let bytes = std::iter::once(&len).chain(body).chain(std::iter::once(&sum));
    let digits: String = bytes.map(|byte| format!("{byte:02X}")).collect();
    [&[ESC], digits.as_bytes()].concat()
}

fn read(start: u16, count: u16) -> Reply {
    let entry = |number: u16| Entry {
        changed: Inputs(1),
        state: Inputs(u32::from(number % 2)),
        time: TimeStamp {
            year: 26,
            month: 11,
            day: 22,
            hour: 10,
            minute: 0,
            second: 0,
            millisecond: number,
        },
    };
    let entries = (start..start.saturating_add(count)).take_while(|&number| number <= 3);
    Reply::Read(ReadReply {
        model: Some(Model::Ser160),
        total: 3,
        next_slot: 3,
        start,
        entries: entries.map(entry).collect(),
    })
}
