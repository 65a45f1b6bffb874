//! The RS-232 port: bytes become commands; replies and text lines become bytes.
//!
//! The port holds one message at a time. It asks for the next one when that has gone out.

use ser_proto::{Baud, Decoded, FrameDecoder, FrameEncoder, FrameError, Reply};

use crate::arrival::{Arrival, Way};
use crate::print_line::PrintLine;
use crate::served::command_in;

/// Bytes of the longest command (set clock and configure are shorter than this).
const MAX_COMMAND_LEN: usize = 16;

/// State of the port.
pub(crate) struct SerialPort {
    decoder: FrameDecoder<MAX_COMMAND_LEN>,
    outgoing: Outgoing,
    /// Rate at which the board drives the line.
    baud: Baud,
}

/// What is being sent.
enum Outgoing {
    Nothing,
    Frame(FrameEncoder),
    Line(PrintLine),
}

impl Iterator for Outgoing {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let byte = match self {
            Outgoing::Nothing => None,
            Outgoing::Frame(frame) => frame.next(),
            Outgoing::Line(line) => line.next(),
        };
        if byte.is_none() {
            *self = Outgoing::Nothing;
        }
        byte
    }
}

impl SerialPort {
    pub(crate) fn new(baud: Baud) -> SerialPort {
        SerialPort { decoder: FrameDecoder::new(), outgoing: Outgoing::Nothing, baud }
    }

    /// Takes a byte that arrived at `tick_ms`. Returns the command that it completes, or the fault
    /// of the frame.
    pub(crate) fn receive(
        &mut self,
        byte: u8,
        tick_ms: u32,
    ) -> Option<Result<Arrival, FrameError>> {
        match self.decoder.push(byte)? {
            Decoded::Frame(body) => {
                let command = command_in(body);
                Some(Ok(Arrival { command, tick_ms, is_seen: true, way: Way::Line }))
            }
            Decoded::Dropped(dropped) => Some(Err(dropped.cause)),
            // A recorder expects no text.
            Decoded::Text(_) => None,
        }
    }

    /// Sends a reply. Nothing else may be on its way.
    pub(crate) fn send(&mut self, reply: &Reply) {
        self.outgoing = Outgoing::Frame(FrameEncoder::new(reply.to_body()));
    }

    /// Sends a line of text. Nothing else may be on its way.
    pub(crate) fn print(&mut self, line: PrintLine) {
        self.outgoing = Outgoing::Line(line);
    }

    /// The next byte of what is being sent.
    pub(crate) fn next_byte(&mut self) -> Option<u8> {
        self.outgoing.next()
    }

    /// The rate to which the line must change now. A configuration is carried out when its reply
    /// goes out, so that reply is the last message at the old rate.
    pub(crate) fn baud_change(&self, configured: Baud) -> Option<Baud> {
        let drained = matches!(self.outgoing, Outgoing::Nothing);
        (configured != self.baud && drained).then_some(configured)
    }

    /// Notes that the line has changed its rate.
    pub(crate) fn baud_changed(&mut self, baud: Baud) {
        self.baud = baud;
    }
}
