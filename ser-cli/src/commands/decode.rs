//! `decode`: a capture of the line, or bodies, back to messages.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::PathBuf;

use ser_proto::ESC;

use crate::decoding::{CaptureFormat, Decoder, Listing, Side, Tally};
use crate::error::{Failure, Result, advise, inform};
use crate::output::Palette;

/// How far into the input an ESC is looked for before it is taken for hex text.
const SNIFF_LEN: usize = 64 * 1024;

const EXAMPLES: &str = "\
Examples:
  ser-cli decode capture.bin                    a capture of the line
  ser-cli decode --from unit capture.bin        only the unit was listened to
  echo '1B 30 31 34 35 34 35' | ser-cli decode  hex text
  echo 52 01 F4 05 | ser-cli decode --body      bodies, one a line";

/// Show what the bytes of a capture mean, damaged ones included.
///
/// Each line of the list gives the place (bytes from the start; in hex text line:column), who sent it, and what
/// it says. Damage is listed where it is found, and decoding goes on behind it; a summary goes to standard
/// error. The exit code is 0 also when something was damaged: the decoding itself worked.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// What to decode; `-` is standard input.
    #[arg(default_value = "-")]
    file: PathBuf,

    /// Who sent the bytes; without it, messages that both sides could have sent are shown with both readings.
    #[arg(long, value_name = "SIDE")]
    from: Option<Side>,

    /// What the input looks like; without it, it is hex text if its first line is and no ESC byte (1Bh) is in the first 64 KiB.
    #[arg(long)]
    format: Option<CaptureFormat>,

    /// The input holds bodies without framing: in hex text one per line, raw a single one.
    #[arg(long)]
    body: bool,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let (name, input) = open(args)?;
    let out = BufWriter::new(io::stdout());
    let mut list = Listing::new(out, Palette::of_stdout());
    let input_error = decode(args, input, &mut list)?;
    list.flush()?;
    match input_error {
        Some(error) => Err(Failure::reading(name, &error)),
        None => {
            summarize(list.tally());
            Ok(())
        }
    }
}

fn open(args: &Args) -> Result<(String, Box<dyn Read>)> {
    if args.file.as_os_str() == "-" {
        return Ok(("standard input".to_string(), Box::new(io::stdin())));
    }
    let name = args.file.display().to_string();
    let file = File::open(&args.file).map_err(|error| Failure::reading(&name, &error))?;
    Ok((name, Box::new(file)))
}

fn summarize(tally: Tally) {
    inform(tally);
    if tally.is_empty() {
        advise("nothing in there to decode; bodies without ESC frames need --body");
    }
}

/// Decodes all of `input`. Failing to write ends it; failing to read is told apart and given back.
fn decode<W: Write>(args: &Args, input: impl Read, list: &mut Listing<W>) -> Result<Option<io::Error>> {
    let mut input = BufReader::with_capacity(SNIFF_LEN, input);
    let (start, mut read_error) = sniff(&mut input);
    let is_hex = args.body || (!start.contains(&ESC) && begins_as_hex(&start));
    let format = args.format.unwrap_or(if is_hex { CaptureFormat::Hex } else { CaptureFormat::Raw });
    let mut decoder = Decoder::new(args.from, args.body, format);
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

/// Whether the first line that is not empty consists of what hex text consists of, or is a comment.
fn begins_as_hex(start: &[u8]) -> bool {
    let first = start.trim_ascii_start().split(|&byte| byte == b'\n').next().unwrap_or_default();
    let code = first.split(|&byte| byte == b'#').next().unwrap_or_default();
    let mut words = code.split(|&byte| byte == b',' || byte.is_ascii_whitespace());
    words.all(|word| {
        let digits = word.strip_prefix(b"0x").or_else(|| word.strip_prefix(b"0X")).unwrap_or(word);
        digits.iter().all(u8::is_ascii_hexdigit)
    })
}

/// Reads until an ESC shows up, at most [`SNIFF_LEN`] bytes.
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

    fn args() -> Args {
        Args { file: PathBuf::from("-"), from: None, format: None, body: false }
    }

    fn decoded(args: &Args, input: &[u8]) -> Vec<String> {
        let mut out = Vec::new();
        let mut list = Listing::new(&mut out, Palette::plain());
        assert!(decode(args, input, &mut list).unwrap().is_none());
        let tally = list.tally().to_string();
        let text = String::from_utf8(out).unwrap();
        text.lines().map(|line| line.trim_start().to_string()).chain([tally]).collect()
    }

    #[test]
    fn a_raw_capture_is_told_by_its_esc() {
        assert_eq!(
            decoded(&args(), b"ready\r\n\x1B0452000105580A\x1B014545"),
            [
                "0  text    ready",
                "7  host    read 5 entries from entry 1",
                "20  text    0A",
                "22  either  host: erase the event buffer | unit: event buffer erased",
                "2 messages, 2 lines of text, nothing damaged"
            ]
        );
    }

    #[test]
    fn a_capture_of_nothing_but_text_is_raw() {
        assert_eq!(
            decoded(&args(), b"\r\n0001 2026-11-22 10:00:00.250  3 ON\r\n0002 ACE\r\n"),
            [
                "2  text    0001 2026-11-22 10:00:00.250  3 ON",
                "38  text    0002 ACE",
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
            decoded(&args(), b"# erase\n1B 30 31 34 35 34 35\n1B303134433443\n"),
            [
                "2:1  either  host: erase the event buffer | unit: event buffer erased",
                "3:1  host    query the last broadcast",
                "2 messages, nothing damaged"
            ]
        );
    }

    #[test]
    fn decoding_goes_on_behind_damage() {
        assert_eq!(
            decoded(&Args { from: Some(Side::Host), ..args() }, b"\x1B014546\x1B0145\x1B01G\x1B014C4C\x1B01"),
            [
                "0  damage  frame given up at byte 6: checksum is 46h, the bytes add up to 45h",
                "7  damage  frame given up at byte 12: a new frame began before it was complete",
                "12  damage  frame given up at byte 15: byte 47h is no hexadecimal digit",
                "16  host    query the last broadcast",
                "23  damage  the data ends inside the frame",
                "1 message, 4 damaged places"
            ]
        );
    }

    #[test]
    fn damaged_hex_text_is_named_by_line_and_column() {
        assert_eq!(
            decoded(
                &Args { from: Some(Side::Host), ..args() },
                b"1B 30 31 34 35 34 3\n1B 30 31 34 ?35 34 35"
            ),
            [
                "1:19  damage  odd number of digits: a single 3, skipped",
                "1:1  damage  frame given up at line 2, column 1: a new frame began before it was complete",
                "2:13  damage  '?' is no hexadecimal digit, skipped",
                "2:1  host    erase the event buffer",
                "1 message, 3 damaged places"
            ]
        );
    }

    #[test]
    fn bodies_come_one_per_line() {
        assert_eq!(
            decoded(&Args { body: true, ..args() }, b"52 01 F4 05\n\n1B\n53"),
            [
                "1:1  host    read 5 entries from entry 500",
                "3:1  damage  no message: unknown command byte 1Bh (1B)",
                "4:1  unit    clock set",
                "2 messages, 1 damaged place"
            ]
        );
        let raw = Args { body: true, format: Some(CaptureFormat::Raw), ..args() };
        assert_eq!(decoded(&raw, b"\x52\x01\xF4\x05")[0], "0  host    read 5 entries from entry 500");
        assert_eq!(decoded(&raw, &[0x52; 300])[0], "0  damage  a body of more than 255 bytes");
    }

    #[test]
    fn the_format_can_be_forced() {
        let hex = Args { format: Some(CaptureFormat::Hex), ..args() };
        assert_eq!(
            decoded(&hex, b"\x1B")[0],
            "1:1  damage  an ESC byte in hex text (--format raw?) is no hexadecimal digit, skipped"
        );
        let raw = Args { format: Some(CaptureFormat::Raw), ..args() };
        assert_eq!(decoded(&raw, b"1B 30")[0], "0  text    1B 30");
    }

    #[test]
    fn it_makes_no_difference_how_the_input_is_cut() {
        struct Crumbs<'a>(&'a [u8]);
        impl Read for Crumbs<'_> {
            fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
                let (Some((&byte, rest)), Some(place)) = (self.0.split_first(), buf.first_mut()) else {
                    return Ok(0);
                };
                *place = byte;
                self.0 = rest;
                Ok(1)
            }
        }
        let capture = b"ready\r\n\x1B045200010558\x1B014546 noise";
        let mut out = Vec::new();
        decode(&args(), Crumbs(capture), &mut Listing::new(&mut out, Palette::plain())).unwrap();
        let text = String::from_utf8(out).unwrap();
        let whole = decoded(&args(), capture);
        assert_eq!(text.lines().map(str::trim_start).collect::<Vec<_>>(), whole[..whole.len() - 1]);
    }
}
