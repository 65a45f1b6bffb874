//! Text of any origin, line by line.
//!
//! Lists of other recorders come from terminals, spreadsheets and old programs. UTF-8 and UTF-16 with
//! a mark at the beginning are told apart by that mark. Bytes that are no UTF-8 are taken for
//! Latin-1, which is told. A line ends with LF, CR LF or CR. Whatever comes, one line is held.

use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};

use super::notes::Refusal;
use crate::error::MAX_LINE_LEN;

/// A file whose encoding was looked at.
pub(super) type Input<'a> = Box<dyn BufRead + 'a>;

/// How much of a file is looked at before it is known what it is.
pub(super) const HEAD_LEN: usize = 1 << 16;

/// As far as this no text has a zero byte, nor has the text before binary data.
const TEXT_LEN: usize = 64;

/// The input without a byte order mark and with UTF-16 made UTF-8, and how it begins.
pub(super) fn opened<'a>(input: impl Read + 'a) -> Result<(Vec<u8>, Input<'a>), Refusal> {
    let mut input = input;
    let mark = taken(&mut input, 3)?;
    let input: Input<'a> = match mark.as_slice() {
        [0xEF, 0xBB, 0xBF] => Box::new(BufReader::new(input)),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, input, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, input, u16::from_be_bytes),
        _ => Box::new(BufReader::new(Cursor::new(mark).chain(input))),
    };
    let mut input = input;
    let head = taken(&mut input, HEAD_LEN)?;
    if head.is_empty() {
        return Err(Refusal::Empty);
    }
    let beginning = head.get(..TEXT_LEN.min(head.len())).unwrap_or_default();
    match beginning {
        [0, first, 0, second, ..] | [first, 0, second, 0, ..] if *first != 0 && *second != 0 => {
            return Err(Refusal::Utf16);
        }
        beginning if beginning.contains(&0) => return Err(Refusal::NoText),
        _ => {}
    }
    let whole = Cursor::new(head.clone()).chain(input);
    Ok((head, Box::new(whole)))
}

/// Up to `len` bytes, fewer only at the end.
fn taken(input: &mut impl Read, len: usize) -> Result<Vec<u8>, Refusal> {
    let mut bytes = Vec::new();
    let limit = u64::try_from(len).unwrap_or(u64::MAX);
    input.by_ref().take(limit).read_to_end(&mut bytes).map_err(Refusal::Io)?;
    Ok(bytes)
}

fn utf16<'a>(rest: &[u8], input: impl Read + 'a, unit: fn([u8; 2]) -> u16) -> Input<'a> {
    let input = BufReader::new(Cursor::new(rest.to_vec()).chain(input));
    Box::new(BufReader::new(Utf16 { input, unit, high: None, waiting: Cursor::default() }))
}

/// Makes UTF-8 of UTF-16. Halves of characters become the replacement character.
struct Utf16<R> {
    input: BufReader<Chain<Cursor<Vec<u8>>, R>>,
    unit: fn([u8; 2]) -> u16,
    /// The first half of a character of which the second one comes.
    high: Option<u16>,
    waiting: Cursor<Vec<u8>>,
}

/// So many units are made UTF-8 at a time.
const UNITS: usize = 4096;

impl<R: Read> Utf16<R> {
    fn refill(&mut self) -> io::Result<()> {
        let mut units: Vec<u16> = self.high.take().into_iter().collect();
        while units.len() < UNITS {
            let mut pair = [0; 2];
            match self.input.read_exact(&mut pair) {
                Ok(()) => units.push((self.unit)(pair)),
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => break,
                Err(error) => return Err(error),
            }
        }
        if units.len() == UNITS {
            self.high = units.pop_if(|last| (0xD800..0xDC00).contains(last));
        }
        let text: String = char::decode_utf16(units)
            .map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect();
        self.waiting = Cursor::new(text.into_bytes());
        Ok(())
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.waiting.read(buffer)?;
        if read > 0 || buffer.is_empty() {
            return Ok(read);
        }
        self.refill()?;
        self.waiting.read(buffer)
    }
}

/// The lines of a file.
pub(super) struct TextLines<'a> {
    input: Input<'a>,
    limit: usize,
    raw: Vec<u8>,
    text: String,
    number: u64,
    /// The line that was read last has an end.
    is_ended: bool,
    /// The last line ended with CR, so that an LF belongs to it.
    after_cr: bool,
    latin_1: Option<u64>,
}

/// A line.
#[derive(Clone, Copy)]
pub(super) enum Line<'l> {
    /// This text, without its end; it may be empty.
    Text(&'l str),
    /// It is longer than any that is read.
    TooLong,
}

impl<'a> TextLines<'a> {
    pub(super) fn new(input: Input<'a>) -> TextLines<'a> {
        TextLines::with_limit(input, MAX_LINE_LEN)
    }

    /// Lines of up to `limit` bytes.
    pub(super) fn with_limit(input: Input<'a>, limit: usize) -> TextLines<'a> {
        let (raw, text) = (Vec::new(), String::new());
        let (number, is_ended, after_cr, latin_1) = (0, true, false, None);
        TextLines { input, limit, raw, text, number, is_ended, after_cr, latin_1 }
    }

    /// The number of the line that was read last, from 1.
    pub(super) const fn number(&self) -> u64 {
        self.number
    }

    /// Whether the line that was read last has an end. The last of a file that was cut off has none.
    pub(super) const fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// Counts on from a line of the same file.
    pub(super) const fn count_from(&mut self, number: u64) {
        self.number = number;
    }

    /// The longest line that is read, in bytes.
    pub(super) const fn limit(&self) -> usize {
        self.limit
    }

    /// The bytes of the line that was read last.
    pub(super) fn raw(&self) -> &[u8] {
        &self.raw
    }

    /// The first line that was no UTF-8, if there was one.
    pub(super) const fn latin_1(&self) -> Option<u64> {
        self.latin_1
    }

    /// The next line; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, Refusal> {
        self.raw.clear();
        let mut is_any = false;
        let (mut is_too_long, mut is_ended) = (false, false);
        loop {
            let waiting = match self.input.fill_buf() {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                waiting => waiting.map_err(Refusal::Io)?,
            };
            if waiting.is_empty() {
                break;
            }
            if std::mem::take(&mut self.after_cr) && waiting.first() == Some(&b'\n') {
                self.input.consume(1);
                continue;
            }
            is_any = true;
            let end = waiting.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let part = waiting.get(..end.unwrap_or(waiting.len())).unwrap_or_default();
            is_too_long |= self.raw.len() + part.len() > self.limit;
            if !is_too_long {
                self.raw.extend_from_slice(part);
            }
            self.after_cr = end.is_some_and(|end| waiting.get(end) == Some(&b'\r'));
            let taken = part.len() + usize::from(end.is_some());
            self.input.consume(taken);
            if end.is_some() {
                is_ended = true;
                break;
            }
        }
        if !is_any {
            return Ok(None);
        }
        self.number += 1;
        self.is_ended = is_ended;
        if is_too_long {
            self.raw.clear();
            return Ok(Some(Line::TooLong));
        }
        Ok(Some(Line::Text(self.decoded())))
    }

    /// What follows the line that was read last.
    pub(super) fn into_rest(mut self) -> Result<Input<'a>, Refusal> {
        if self.after_cr && self.input.fill_buf().map_err(Refusal::Io)?.first() == Some(&b'\n') {
            self.input.consume(1);
        }
        Ok(self.input)
    }

    fn decoded(&mut self) -> &str {
        self.text.clear();
        match std::str::from_utf8(&self.raw) {
            Ok(text) => self.text.push_str(text),
            Err(_) => {
                self.latin_1 = self.latin_1.or(Some(self.number));
                self.text.extend(self.raw.iter().copied().map(char::from));
            }
        }
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(bytes: &[u8]) -> Result<Vec<Option<String>>, Refusal> {
        let (_, input) = opened(bytes)?;
        let mut lines = TextLines::with_limit(input, 20);
        let mut found = Vec::new();
        while let Some(line) = lines.next()? {
            found.push(match line {
                Line::Text(text) => Some(text.to_owned()),
                Line::TooLong => None,
            });
            assert_eq!(lines.number(), found.len() as u64);
        }
        Ok(found)
    }

    fn texts(expected: &[&str]) -> Vec<Option<String>> {
        expected.iter().map(|text| Some((*text).to_owned())).collect()
    }

    #[test]
    fn a_line_ends_with_any_of_the_three_ends() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["a", "", "b", ""].join(end);
            assert_eq!(all(text.as_bytes()).unwrap(), texts(&["a", "", "b"]), "{end:?}");
        }
        assert!(matches!(all(b""), Err(Refusal::Empty)));
        assert_eq!(all(b"a\n\rb").unwrap(), texts(&["a", "", "b"]));
    }

    #[test]
    fn text_is_the_same_in_every_encoding() {
        let text = "Umspannwerk Süd\n52-1 \u{1F4A1}";
        let expected = texts(&["Umspannwerk Süd", "52-1 \u{1F4A1}"]);
        let units = || text.encode_utf16();
        let little: Vec<u8> =
            [0xFF, 0xFE].into_iter().chain(units().flat_map(u16::to_le_bytes)).collect();
        let big: Vec<u8> =
            [0xFE, 0xFF].into_iter().chain(units().flat_map(u16::to_be_bytes)).collect();
        let marked = ["\u{FEFF}", text].concat();
        for bytes in [text.as_bytes(), marked.as_bytes(), &little, &big] {
            assert_eq!(all(bytes).unwrap(), expected);
        }
        assert_eq!(all(b"S\xFCd").unwrap(), texts(&["Süd"]));
    }

    #[test]
    fn a_character_of_two_units_may_lie_over_any_boundary() {
        for before in UNITS - 3..UNITS + 3 {
            let text = format!("{}\u{1F4A1}b", "x\n".repeat(before / 2) + &"y".repeat(before % 2));
            let bytes: Vec<u8> = [0xFF, 0xFE]
                .into_iter()
                .chain(text.encode_utf16().flat_map(u16::to_le_bytes))
                .collect();
            let (_, mut input) = opened(bytes.as_slice()).unwrap();
            let mut read = String::new();
            input.read_to_string(&mut read).unwrap();
            assert!(read == text, "{before}");
        }
    }

    #[test]
    fn what_is_no_text_is_refused_by_name() {
        assert!(matches!(all(b"a\0b\0c\0"), Err(Refusal::Utf16)));
        assert!(matches!(all(b"\0a\0b\0c"), Err(Refusal::Utf16)));
        assert!(matches!(all(b"\x01\0\0\0\x02"), Err(Refusal::NoText)));
    }

    #[test]
    fn of_an_overlong_line_nothing_is_kept_and_the_next_one_is_read() {
        let text = ["a", &"x".repeat(100_000), "b"].join("\r");
        assert_eq!(
            all(text.as_bytes()).unwrap(),
            [Some("a".to_owned()), None, Some("b".to_owned())]
        );
    }

    #[test]
    fn what_follows_a_line_is_left_untouched() {
        for text in ["a\r\n\nb", "a\n\nb"] {
            let (_, input) = opened(text.as_bytes()).unwrap();
            let mut lines = TextLines::new(input);
            lines.next().unwrap();
            let mut rest = String::new();
            lines.into_rest().unwrap().read_to_string(&mut rest).unwrap();
            assert_eq!(rest, "\nb");
        }
    }
}
