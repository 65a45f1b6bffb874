//! An original recorder behind a terminal server: it answers reads, and stays silent to everything
//! that only our recorders know.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use ser_proto::{
    Command, Decoded, Entry, FrameDecoder, FrameEncoder, Inputs, Model, ReadReply, Reply, TimeStamp,
};

/// An original recorder with three events.
pub(crate) struct Original {
    port: u16,
    heard: Arc<Mutex<Vec<u8>>>,
}

impl Original {
    pub(crate) fn start() -> Original {
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
                    if let Ok(Command::Read { start, count }) = Command::parse(body) {
                        let frame = FrameEncoder::new(read(start, count.into()).to_body());
                        let _ = stream.write_all(&frame.collect::<Vec<_>>());
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
