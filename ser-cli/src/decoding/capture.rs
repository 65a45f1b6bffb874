//! A whole capture: its format, and its messages one after the other.

use std::io::{self, BufRead, BufReader, Read, Write};

use ser_proto::ESC;

use super::{CaptureFormat, Decoder, Listing, Side};

/// How far into the input an ESC is searched for before the input is taken for hex text.
const SNIFF_LEN: usize = 64 * 1024;

/// How to read a capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CaptureOptions {
    /// Who sent the bytes; without it, messages that both sides could have sent are shown with both
    /// readings.
    pub from: Option<Side>,
    /// The format of the input; without it, hex text if the first line is hex and no ESC is near
    /// the beginning.
    pub format: Option<CaptureFormat>,
    /// Whether the input holds bodies without framing: in hex text one per line, raw a single one.
    pub bodies: bool,
}

impl CaptureOptions {
    /// Decodes all of `input` and lists its content, damage included. Any bytes are a capture. When
    /// reading fails, the bytes before are listed, and the error is returned.
    ///
    /// # Errors
    /// When the list cannot be written.
    pub fn decode<W: Write>(
        self,
        input: impl Read,
        list: &mut Listing<W>,
    ) -> io::Result<Option<io::Error>> {
        let mut input = BufReader::with_capacity(SNIFF_LEN, input);
        let (start, mut read_error) = sniff(&mut input);
        let is_hex = self.bodies || (!start.contains(&ESC) && begins_as_hex(&start));
        let format =
            self.format.unwrap_or(if is_hex { CaptureFormat::Hex } else { CaptureFormat::Raw });
        let mut decoder = Decoder::new(self.from, self.bodies, format);
        decoder.take(&start, list)?;
        while read_error.is_none() {
            match input.fill_buf() {
                Ok([]) => break,
                Ok(bytes) => {
                    decoder.take(bytes, list)?;
                    let len = bytes.len();
                    input.consume(len);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => read_error = Some(error),
            }
        }
        decoder.finish(list)?;
        Ok(read_error)
    }
}

/// Whether the first line that is not empty contains only characters of hex text, or is a comment.
fn begins_as_hex(start: &[u8]) -> bool {
    let first = start.trim_ascii_start().split(|&byte| byte == b'\n').next().unwrap_or_default();
    let code = first.split(|&byte| byte == b'#').next().unwrap_or_default();
    let mut words = code.split(|&byte| byte == b',' || byte.is_ascii_whitespace());
    words.all(|word| {
        let digits = word.strip_prefix(b"0x").or_else(|| word.strip_prefix(b"0X")).unwrap_or(word);
        digits.iter().all(u8::is_ascii_hexdigit)
    })
}

/// Reads until an ESC appears, at most [`SNIFF_LEN`] bytes.
fn sniff(input: &mut impl Read) -> (Vec<u8>, Option<io::Error>) {
    let mut start = vec![0; SNIFF_LEN];
    let mut len = 0;
    let mut read_error = None;
    while len < SNIFF_LEN && !start[..len].contains(&ESC) {
        match input.read(&mut start[len..]) {
            Ok(0) => break,
            Ok(more) => len += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => {
                read_error = Some(error);
                break;
            }
        }
    }
    start.truncate(len);
    (start, read_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANY: CaptureOptions = CaptureOptions { from: None, format: None, bodies: false };

    fn decoded(options: CaptureOptions, input: &[u8]) -> Vec<String> {
        let mut out = Vec::new();
        let mut list = Listing::plain(&mut out);
        assert!(options.decode(input, &mut list).unwrap().is_none());
        let tally = list.tally().to_string();
        let text = String::from_utf8(out).unwrap();
        text.lines().map(|line| line.trim_start().to_string()).chain([tally]).collect()
    }

    #[test]
    fn a_raw_capture_is_told_by_its_esc() {
        assert_eq!(
            decoded(ANY, b"ready\r\n\x1B0452000105580A\x1B014545"),
            [
                "0  text      ready",
                "7  host      read 5 entries from entry 1",
                "20  text      0A",
                "22  either    host: erase the event buffer | recorder: event buffer erased",
                "2 messages, 2 lines of text, nothing damaged"
            ]
        );
    }

    #[test]
    fn a_capture_of_nothing_but_text_is_raw() {
        assert_eq!(
            decoded(ANY, b"\r\n0001 2026-11-22 10:00:00.250  3 ON\r\n0002 ACE\r\n"),
            [
                "2  text      0001 2026-11-22 10:00:00.250  3 ON",
                "38  text      0002 ACE",
                "0 messages, 2 lines of text, nothing damaged"
            ]
        );
        for hex in ["", "\n\n1B 30", "1b,30\nready", "0x1B, 0X30\r\n", "# ready\n1B", "1B3 # x"] {
            assert!(begins_as_hex(hex.as_bytes()), "{hex}");
        }
        for raw in ["ready", "1B 30?", "\n0001 2026-11-22", "1B x30"] {
            assert!(!begins_as_hex(raw.as_bytes()), "{raw}");
        }
    }

    #[test]
    fn hex_text_gives_lines_and_columns() {
        assert_eq!(
            decoded(ANY, b"# erase\n1B 30 31 34 35 34 35\n1B303134433443\n"),
            [
                "2:1  either    host: erase the event buffer | recorder: event buffer erased",
                "3:1  host      query the last broadcast",
                "2 messages, nothing damaged"
            ]
        );
    }

    #[test]
    fn decoding_goes_on_behind_damage() {
        assert_eq!(
            decoded(
                CaptureOptions { from: Some(Side::Host), ..ANY },
                b"\x1B014546\x1B0145\x1B01G\x1B014C4C\x1B01"
            ),
            [
                "0  damage    frame given up at byte 6: checksum is 46h, the bytes add up to 45h",
                "7  damage    frame given up at byte 12: a new frame began before it was complete",
                "12  damage    frame given up at byte 15: byte 47h is no hexadecimal digit",
                "16  host      query the last broadcast",
                "23  damage    the data ends inside the frame",
                "1 message, 4 damaged places"
            ]
        );
    }

    #[test]
    fn damaged_hex_text_is_named_by_line_and_column() {
        assert_eq!(
            decoded(
                CaptureOptions { from: Some(Side::Host), ..ANY },
                b"1B 30 31 34 35 34 3\n1B 30 31 34 ?35 34 35"
            ),
            [
                "1:19  damage    odd number of digits: a single 3, skipped",
                "1:1  damage    frame given up at line 2, column 1: a new frame began before it \
                 was complete",
                "2:13  damage    '?' is not a hexadecimal digit, skipped",
                "2:1  host      erase the event buffer",
                "1 message, 3 damaged places"
            ]
        );
    }

    #[test]
    fn bodies_come_one_per_line() {
        assert_eq!(
            decoded(CaptureOptions { bodies: true, ..ANY }, b"52 01 F4 05\n\n1B\n53"),
            [
                "1:1  host      read 5 entries from entry 500",
                "3:1  damage    not a message: unknown command byte 1Bh (1B)",
                "4:1  recorder  clock set",
                "2 messages, 1 damaged place"
            ]
        );
        let raw = CaptureOptions { bodies: true, format: Some(CaptureFormat::Raw), ..ANY };
        assert_eq!(
            decoded(raw, b"\x52\x01\xF4\x05")[0],
            "0  host      read 5 entries from entry 500"
        );
        assert_eq!(decoded(raw, &[0x52; 300])[0], "0  damage    a body of more than 255 bytes");
    }

    #[test]
    fn the_format_can_be_forced() {
        let hex = CaptureOptions { format: Some(CaptureFormat::Hex), ..ANY };
        assert_eq!(
            decoded(hex, b"\x1B")[0],
            "1:1  damage    an ESC byte in hex text (--format raw?) is not a hexadecimal digit, \
             skipped"
        );
        let raw = CaptureOptions { format: Some(CaptureFormat::Raw), ..ANY };
        assert_eq!(decoded(raw, b"1B 30")[0], "0  text      1B 30");
    }

    #[test]
    fn it_makes_no_difference_how_the_input_is_cut() {
        struct Crumbs<'a>(&'a [u8]);
        impl Read for Crumbs<'_> {
            fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
                let (Some((&byte, rest)), Some(place)) = (self.0.split_first(), buf.first_mut())
                else {
                    return Ok(0);
                };
                *place = byte;
                self.0 = rest;
                Ok(1)
            }
        }
        let capture = b"ready\r\n\x1B045200010558\x1B014546 noise";
        let mut out = Vec::new();
        ANY.decode(Crumbs(capture), &mut Listing::plain(&mut out)).unwrap();
        let text = String::from_utf8(out).unwrap();
        let whole = decoded(ANY, capture);
        assert_eq!(text.lines().map(str::trim_start).collect::<Vec<_>>(), whole[..whole.len() - 1]);
    }
}
