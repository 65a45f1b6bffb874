//! From the bytes of a capture to the lines of the list.

use std::io::{self, Write};

use clap::ValueEnum;
use ser_proto::{Decoded, ESC, FrameDecoder};

use super::{HexText, HexToken, Kind, LineAssembler, Listing, Place, Side, explain};

/// The maximum length of a body, because its length has to fit a byte.
const MAX_BODY: usize = 255;

/// The format of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CaptureFormat {
    /// The bytes as they are.
    Raw,
    /// Text like `1B 30 31`; blanks, commas, 0x and # comments are allowed.
    Hex,
}

/// Takes the bytes of the input; writes the lines of the list.
pub(crate) struct Decoder {
    from: Option<Side>,
    format: CaptureFormat,
    hex: HexText,
    /// How much of a raw input has been taken.
    offset: u64,
    // Every length that a frame can announce fits, so that an impossible one is reported as such.
    frames: FrameDecoder<MAX_BODY>,
    frame_start: Place,
    text: LineAssembler,
    /// The body being collected, where bodies come without frames.
    body: Option<Vec<u8>>,
    body_start: Place,
}

impl Decoder {
    /// A decoder for bytes that `from` sent; `bodies` says that they come without frames.
    pub(crate) fn new(from: Option<Side>, bodies: bool, format: CaptureFormat) -> Decoder {
        let start = Place::Offset(0);
        Decoder {
            from,
            format,
            hex: HexText::new(),
            offset: 0,
            frames: FrameDecoder::new(),
            frame_start: start,
            text: LineAssembler::default(),
            body: bodies.then(Vec::new),
            body_start: start,
        }
    }

    /// Takes the next part of the input. Bytes from a pipe are shown as soon as they come.
    pub(crate) fn take<W: Write>(&mut self, bytes: &[u8], list: &mut Listing<W>) -> io::Result<()> {
        for &byte in bytes {
            match self.format {
                CaptureFormat::Raw => {
                    self.byte(byte, Place::Offset(self.offset), list)?;
                    self.offset += 1;
                }
                CaptureFormat::Hex => {
                    let tokens = self.hex.push(byte);
                    tokens.into_iter().flatten().try_for_each(|token| self.token(token, list))?;
                }
            }
        }
        list.flush()
    }

    fn token<W: Write>(&mut self, token: HexToken, list: &mut Listing<W>) -> io::Result<()> {
        match token {
            HexToken::Byte(byte, place) => self.byte(byte, place, list),
            HexToken::Junk(character, place) => {
                let text = format!("{} is not a hexadecimal digit, skipped", shown(character));
                list.add(place, Kind::Damage, &text, &[])
            }
            HexToken::Half(digit, place) => {
                let text = format!("odd number of digits: a single {digit}, skipped");
                list.add(place, Kind::Damage, &text, &[])
            }
            HexToken::LineEnd => self.end_of_body(list),
        }
    }

    fn byte<W: Write>(&mut self, byte: u8, place: Place, list: &mut Listing<W>) -> io::Result<()> {
        if let Some(body) = &mut self.body {
            if body.is_empty() {
                self.body_start = place;
            }
            // One byte more than possible is kept, to recognise that the body is too long.
            if body.len() <= MAX_BODY {
                body.push(byte);
            }
            return Ok(());
        }
        if byte == ESC {
            self.end_of_text(list)?;
        }
        let start = self.frame_start;
        match self.frames.push(byte) {
            None => {}
            Some(Decoded::Text(byte)) => {
                if let Some(line) = self.text.push(byte, place) {
                    list.add(line.place, line.kind, &line.text, &[])?;
                }
            }
            Some(Decoded::Frame(body)) => {
                let message = explain(body, self.from);
                list.add(start, message.kind, &message.text, &message.details)?;
            }
            Some(Decoded::Dropped(dropped)) => {
                let text = format!("frame given up at {place}: {}", dropped.cause);
                list.add(start, Kind::Damage, &text, &[])?;
            }
        }
        if byte == ESC {
            self.frame_start = place;
        }
        Ok(())
    }

    /// Ends the input, and lists what is unfinished.
    pub(crate) fn finish<W: Write>(&mut self, list: &mut Listing<W>) -> io::Result<()> {
        if let Some(token) = self.hex.finish() {
            self.token(token, list)?;
        }
        self.end_of_body(list)?;
        self.end_of_text(list)?;
        match self.frames.finish() {
            Some(dropped) => {
                list.add(self.frame_start, Kind::Damage, &dropped.cause.to_string(), &[])
            }
            None => Ok(()),
        }
    }

    fn end_of_text<W: Write>(&mut self, list: &mut Listing<W>) -> io::Result<()> {
        match self.text.finish() {
            Some(line) => list.add(line.place, line.kind, &line.text, &[]),
            None => Ok(()),
        }
    }

    fn end_of_body<W: Write>(&mut self, list: &mut Listing<W>) -> io::Result<()> {
        let Some(body) = self.body.as_mut().filter(|body| !body.is_empty()) else { return Ok(()) };
        let body = std::mem::take(body);
        if body.len() > MAX_BODY {
            let text = format!("a body of more than {MAX_BODY} bytes");
            return list.add(self.body_start, Kind::Damage, &text, &[]);
        }
        let message = explain(&body, self.from);
        list.add(self.body_start, message.kind, &message.text, &message.details)
    }
}

fn shown(character: char) -> String {
    match character {
        char::REPLACEMENT_CHARACTER => "a byte that is not text".to_string(),
        '\x1B' => "an ESC byte in hex text (--format raw?)".to_string(),
        other => format!("'{}'", other.escape_debug()),
    }
}
