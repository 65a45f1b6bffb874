//! The ESC frame around a body on RS-232 (manual, section "RS-232 Serial Access").
//!
//! ```text
//! ESC LL CC PP … CS      LL: number of body bytes      CS: low eight bits of their sum
//! ```
//!
//! ESC is the raw byte; every other byte goes out as two characters of `0–9 A–F`.

use crate::Body;

/// The byte that starts a frame, and appears nowhere else.
pub const ESC: u8 = 0x1B;

/// Characters on the wire for a body of `body_len` bytes.
#[must_use]
pub const fn encoded_len(body_len: usize) -> usize {
    1 + 2 * (1 + body_len + 1)
}

/// The characters of the frame around one body.
#[derive(Clone, Debug)]
pub struct FrameEncoder {
    body: Body,
    position: usize,
}

impl FrameEncoder {
    /// The frame around `body`, starting with the ESC.
    #[must_use]
    pub const fn new(body: Body) -> FrameEncoder {
        FrameEncoder { body, position: 0 }
    }

    /// The byte that the characters `2 * index` and `2 * index + 1` after the ESC stand for.
    fn byte(&self, index: usize) -> Option<u8> {
        let len = self.body.len();
        match index {
            0 => u8::try_from(len).ok(),
            _ if index <= len => self.body.get(index - 1).copied(),
            _ if index == len + 1 => Some(checksum(&self.body)),
            _ => None,
        }
    }
}

impl Iterator for FrameEncoder {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        let character = match self.position.checked_sub(1) {
            None => ESC,
            Some(digit) => {
                let byte = self.byte(digit / 2)?;
                hex_digit(if digit % 2 == 0 { byte >> 4 } else { byte & 0x0F })
            }
        };
        self.position += 1;
        Some(character)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = encoded_len(self.body.len()).saturating_sub(self.position);
        (left, Some(left))
    }
}

impl ExactSizeIterator for FrameEncoder {}

/// The low eight bits of the sum of the body's bytes.
pub(crate) fn checksum(body: &[u8]) -> u8 {
    body.iter().fold(0, |sum, &byte| sum.wrapping_add(byte))
}

const fn hex_digit(nibble: u8) -> u8 {
    match nibble {
        0..=9 => b'0' + nibble,
        _ => b'A' + nibble - 10,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Command, Reply};

    #[test]
    fn erase_is_seven_characters() {
        let frame: Vec<u8> = FrameEncoder::new(Command::Erase.to_body()).collect();
        assert_eq!(frame, b"\x1B014545");
    }

    #[test]
    fn the_length_is_known_beforehand() {
        let mut frame = FrameEncoder::new(Reply::LastBroadcast(None).to_body());
        assert_eq!(frame.len(), encoded_len(7));
        frame.next();
        assert_eq!(frame.len(), frame.count());
    }
}
