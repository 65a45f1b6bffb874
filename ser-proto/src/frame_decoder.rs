//! Finds ESC frames in a stream of bytes.
//!
//! The decoder works one byte at a time and needs no time-out. An ESC always starts a new frame, so
//! a frame that was cut off costs itself and nothing after it. Bytes between frames are text and
//! are passed on. Every dropped frame is reported with its cause and its place in the stream.

use core::fmt;

use heapless::Vec;

use crate::frame_encoder::checksum;
use crate::{ESC, encoded_len};

/// What a byte completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoded<'a> {
    /// The byte stands outside every frame.
    Text(u8),
    /// The body of a complete frame whose checksum holds.
    Frame(&'a [u8]),
    /// A frame was dropped.
    Dropped(DroppedFrame),
}

/// A frame that was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DroppedFrame {
    /// Offset of its ESC, from the first byte that the decoder was given.
    pub start: u64,
    /// Offset of the byte at which the decoder gave it up.
    pub at: u64,
    /// Why.
    pub cause: FrameError,
}

/// Why a frame was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Another ESC came before the frame was complete.
    Interrupted,
    /// A character is not a hexadecimal digit; it is dropped with the frame.
    NotHex {
        /// The character.
        byte: u8,
    },
    /// The checksum does not hold.
    Checksum {
        /// The sum of the bytes that arrived.
        computed: u8,
        /// The sum that the frame gives.
        received: u8,
    },
    /// The announced body is longer than this receiver takes. The rest of the frame is skipped.
    TooLong {
        /// The announced number of bytes.
        length: u8,
    },
    /// The announced body has no bytes at all.
    Empty,
    /// The stream ended inside the frame.
    Incomplete,
}

/// Resumable decoder for bodies of up to `N` bytes.
#[derive(Clone, Debug)]
pub struct FrameDecoder<const N: usize> {
    state: State,
    body: Vec<u8, N>,
    start: u64,
    position: u64,
}

#[derive(Clone, Copy, Debug)]
enum State {
    Text,
    /// Inside a frame; `high` is the first digit of the byte being assembled.
    Frame {
        high: Option<u8>,
        length: Option<u8>,
    },
    /// Inside a frame that was already reported as dropped, with this many digits still to come.
    Skip {
        digits: usize,
    },
}

/// [`Decoded`] without the borrow of the body.
#[derive(Clone, Copy)]
enum Completed {
    Text(u8),
    Frame,
    Dropped(DroppedFrame),
}

const AFTER_ESC: State = State::Frame { high: None, length: None };

impl<const N: usize> FrameDecoder<N> {
    /// A decoder that waits for an ESC.
    #[must_use]
    pub const fn new() -> Self {
        FrameDecoder { state: State::Text, body: Vec::new(), start: 0, position: 0 }
    }

    /// Takes the next byte of the stream; returns what it completed, if anything.
    pub fn push(&mut self, byte: u8) -> Option<Decoded<'_>> {
        self.step(byte).map(|completed| self.show(completed))
    }

    /// Takes bytes from the front of `stream`, up to and including the one that completes
    /// something; the bytes after it stay. `None` means that all were taken and nothing was
    /// completed.
    pub fn push_slice(&mut self, stream: &mut &[u8]) -> Option<Decoded<'_>> {
        while let Some((&byte, rest)) = stream.split_first() {
            *stream = rest;
            if let Some(completed) = self.step(byte) {
                return Some(self.show(completed));
            }
        }
        None
    }

    fn step(&mut self, byte: u8) -> Option<Completed> {
        let at = self.position;
        self.position += 1;
        match (self.state, hex_value(byte)) {
            (State::Frame { .. }, _) if byte == ESC => {
                let dropped =
                    DroppedFrame { start: self.start, at, cause: FrameError::Interrupted };
                self.begin(at);
                Some(Completed::Dropped(dropped))
            }
            (State::Text | State::Skip { .. }, _) if byte == ESC => {
                self.begin(at);
                None
            }
            (State::Text, _) => Some(Completed::Text(byte)),
            (State::Skip { digits }, Some(_)) => {
                self.state =
                    if digits > 1 { State::Skip { digits: digits - 1 } } else { State::Text };
                None
            }
            (State::Skip { .. }, None) => {
                self.state = State::Text;
                Some(Completed::Text(byte))
            }
            (State::Frame { .. }, None) => Some(self.drop_frame(at, FrameError::NotHex { byte })),
            (State::Frame { high: None, length }, Some(digit)) => {
                self.state = State::Frame { high: Some(digit), length };
                None
            }
            (State::Frame { high: Some(high), length }, Some(low)) => {
                self.take_byte(at, length, high << 4 | low)
            }
        }
    }

    fn show(&self, completed: Completed) -> Decoded<'_> {
        match completed {
            Completed::Text(byte) => Decoded::Text(byte),
            Completed::Frame => Decoded::Frame(&self.body),
            Completed::Dropped(dropped) => Decoded::Dropped(dropped),
        }
    }

    /// Ends the stream and reports a frame that is incomplete. The decoder can then be used again.
    pub fn finish(&mut self) -> Option<DroppedFrame> {
        let unfinished = matches!(self.state, State::Frame { .. });
        self.state = State::Text;
        unfinished.then_some(DroppedFrame {
            start: self.start,
            at: self.position,
            cause: FrameError::Incomplete,
        })
    }

    /// Whether a frame has begun and is not yet complete.
    #[must_use]
    pub const fn inside_frame(&self) -> bool {
        !matches!(self.state, State::Text)
    }

    /// How many bytes the decoder has taken: the offset of the next one.
    #[must_use]
    pub const fn position(&self) -> u64 {
        self.position
    }

    fn begin(&mut self, at: u64) {
        self.start = at;
        self.body.clear();
        self.state = AFTER_ESC;
    }

    fn take_byte(&mut self, at: u64, length: Option<u8>, byte: u8) -> Option<Completed> {
        self.state = State::Frame { high: None, length: Some(length.unwrap_or(byte)) };
        match length {
            None if byte == 0 => Some(self.drop_frame(at, FrameError::Empty)),
            None if usize::from(byte) > N => {
                Some(self.drop_frame(at, FrameError::TooLong { length: byte }))
            }
            None => None,
            // The push cannot fail: a frame longer than `N` was dropped at its length.
            Some(length) if self.body.len() < usize::from(length) => self
                .body
                .push(byte)
                .err()
                .map(|_| self.drop_frame(at, FrameError::TooLong { length })),
            Some(_) => {
                let computed = checksum(&self.body);
                if computed != byte {
                    return Some(
                        self.drop_frame(at, FrameError::Checksum { computed, received: byte }),
                    );
                }
                self.state = State::Text;
                Some(Completed::Frame)
            }
        }
    }

    fn drop_frame(&mut self, at: u64, cause: FrameError) -> Completed {
        self.state = match cause {
            // ESC and length have been taken; an empty body still has its checksum to come.
            FrameError::TooLong { length } => {
                State::Skip { digits: encoded_len(length.into()) - 3 }
            }
            FrameError::Empty => State::Skip { digits: 2 },
            _ => State::Text,
        };
        Completed::Dropped(DroppedFrame { start: self.start, at, cause })
    }
}

impl<const N: usize> Default for FrameDecoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

const fn hex_value(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'A'..=b'F' => Some(character - b'A' + 10),
        b'a'..=b'f' => Some(character - b'a' + 10),
        _ => None,
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            FrameError::Interrupted => write!(f, "a new frame began before it was complete"),
            FrameError::NotHex { byte } => write!(f, "byte {byte:02X}h is no hexadecimal digit"),
            FrameError::Checksum { computed, received } => {
                write!(f, "checksum is {received:02X}h, the bytes add up to {computed:02X}h")
            }
            FrameError::TooLong { length } => write!(f, "a body of {length} bytes is too long"),
            FrameError::Empty => write!(f, "the body is empty"),
            FrameError::Incomplete => write!(f, "the data ends inside the frame"),
        }
    }
}

impl core::error::Error for FrameError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a stream decodes to, in words that compare and print well.
    fn decode(stream: &[u8]) -> std::vec::Vec<String> {
        let in_words =
            |dropped: DroppedFrame| format!("{}..{} {}", dropped.start, dropped.at, dropped.cause);
        let mut decoder = FrameDecoder::<16>::new();
        let mut seen = std::vec::Vec::new();
        for &byte in stream {
            seen.extend(decoder.push(byte).map(|decoded| match decoded {
                Decoded::Text(byte) => format!("text {}", byte as char),
                Decoded::Frame(body) => format!("frame {body:02X?}"),
                Decoded::Dropped(dropped) => in_words(dropped),
            }));
        }
        seen.extend(decoder.finish().map(in_words));
        seen
    }

    #[test]
    fn a_frame_gives_its_body_in_upper_and_lower_case() {
        assert_eq!(decode(b"\x1B014C4C"), ["frame [4C]"]);
        assert_eq!(decode(b"\x1B014c4c"), ["frame [4C]"]);
    }

    #[test]
    fn what_stands_between_frames_is_text() {
        assert_eq!(decode(b"A\x1B014545\r"), ["text A", "frame [45]", "text \r"]);
    }

    #[test]
    fn esc_starts_a_new_frame_inside_an_unfinished_one() {
        assert_eq!(
            decode(b"\x1B0345\x1B014545"),
            ["0..5 a new frame began before it was complete", "frame [45]"]
        );
    }

    #[test]
    fn a_character_that_is_no_digit_abandons_the_frame() {
        assert_eq!(
            decode(b"\x1B01G45\x1B014545"),
            ["0..3 byte 47h is no hexadecimal digit", "text 4", "text 5", "frame [45]"]
        );
    }

    #[test]
    fn a_wrong_checksum_is_reported_with_both_sums() {
        assert_eq!(
            decode(b"\x1B014546\x1B014545"),
            ["0..6 checksum is 46h, the bytes add up to 45h", "frame [45]"]
        );
    }

    #[test]
    fn a_frame_too_long_is_skipped_whole() {
        let mut stream = b"\x1B11".to_vec();
        stream.extend([b'0'; 36]);
        stream.extend(b"OK\x1B014545");
        assert_eq!(
            decode(&stream),
            ["0..2 a body of 17 bytes is too long", "text O", "text K", "frame [45]"]
        );
        assert_eq!(
            decode(b"\x1BFF00\x1B014545"),
            ["0..2 a body of 255 bytes is too long", "frame [45]"]
        );
    }

    #[test]
    fn an_empty_body_is_no_message() {
        assert_eq!(decode(b"\x1B0000\x1B014545"), ["0..2 the body is empty", "frame [45]"]);
    }

    #[test]
    fn a_stream_that_ends_inside_a_frame_says_so() {
        assert_eq!(decode(b"\x1B0145"), ["0..5 the data ends inside the frame"]);
        assert_eq!(decode(b"\x1B"), ["0..1 the data ends inside the frame"]);
    }
}
