//! What happens to bytes on a bad line, and what bytes become at the wrong rate.
//!
//! The protocol's checksum has eight bits. One in 256 frames that are damaged in more than one bit
//! therefore passes as another frame, and no host and no recorder could know. Towards the host such
//! frames are stopped here and counted, because the simulation is about what can be known. Towards
//! the recorder they pass, because the ledger hears what the recorder hears.

use ser_proto::{Decoded, FrameDecoder, MAX_BODY_LEN};

use super::chance::Chance;

/// How bad the line is: one byte in this many suffers. `None` is a good line.
pub type OneIn = Option<u64>;

/// A byte as it arrives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// This byte.
    Byte(u8),
    /// Something without a stop bit.
    Error,
}

/// What a byte becomes on the way. `garbled` says that the two ends have different rates.
pub fn travel(byte: u8, one_in: OneIn, garbled: bool, chance: &mut Chance, out: &mut Vec<Heard>) {
    if garbled {
        for _ in 0..chance.within(0..=2) {
            out.push(if chance.one_in(3) { Heard::Error } else { Heard::Byte(chance.byte()) });
        }
        return;
    }
    if !one_in.is_some_and(|one_in| chance.one_in(one_in)) {
        out.push(Heard::Byte(byte));
        return;
    }
    match chance.below(6) {
        // The byte is lost.
        0 => {}
        1 => out.extend([Heard::Byte(byte), Heard::Byte(byte)]),
        2 => out.extend([Heard::Byte(byte), Heard::Byte(chance.byte())]),
        3 => out.push(Heard::Error),
        4 => out.push(Heard::Byte(chance.byte())),
        _ => out.push(Heard::Byte(byte ^ 1 << chance.below(7))),
    }
}

/// Stops every damaged frame that would look intact to a host.
#[derive(Clone)]
pub struct FrameGuard {
    /// What the recorder has said, before it travelled.
    said: FrameDecoder<MAX_BODY_LEN>,
    heard: FrameDecoder<MAX_BODY_LEN>,
    bodies: Vec<Vec<u8>>,
    stopped: u64,
}

/// How many frames can be on their way at once on the simulated line.
const BODIES: usize = 1024;

impl FrameGuard {
    /// For a line on which nothing has been said.
    #[must_use]
    pub fn new() -> FrameGuard {
        FrameGuard {
            said: FrameDecoder::new(),
            heard: FrameDecoder::new(),
            bodies: Vec::new(),
            stopped: 0,
        }
    }

    /// The recorder says a byte.
    pub fn said(&mut self, byte: u8) {
        if let Some(Decoded::Frame(body)) = self.said.push(byte) {
            if self.bodies.len() == BODIES {
                self.bodies.drain(..BODIES / 2);
            }
            self.bodies.push(body.to_vec());
        }
    }

    /// The host hears a byte. It gets another one if the byte would complete a frame that nobody
    /// has sent.
    pub fn heard(&mut self, byte: u8) -> u8 {
        let mut ahead = self.heard.clone();
        let forged = match ahead.push(byte) {
            // Searched from the end, because the oldest bodies have already been heard.
            Some(Decoded::Frame(body)) => !self.bodies.iter().rev().any(|said| said == body),
            _ => false,
        };
        if forged {
            self.stopped += 1;
        }
        // The replacement is not a digit, so it ends the frame.
        let byte = if forged { b'?' } else { byte };
        let _ = self.heard.push(byte);
        byte
    }

    /// The host forgets a frame that has begun.
    pub fn forget(&mut self) {
        let _ = self.heard.finish();
    }

    /// Frames that were stopped.
    #[must_use]
    pub fn stopped(&self) -> u64 {
        self.stopped
    }
}

impl Default for FrameGuard {
    fn default() -> FrameGuard {
        FrameGuard::new()
    }
}
