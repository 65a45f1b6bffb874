//! Bytes written as hexadecimal text: `1B 30 31 …`, with or without blanks.
//!
//! Blanks and commas separate bytes, `0x` may precede a byte, and `#` starts a comment that ends
//! with the line.

use super::Place;

/// What a character of hex text completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HexToken {
    /// A byte, and where its first digit stands.
    Byte(u8, Place),
    /// A character without meaning here. A digit right before it belongs to it, and so do more
    /// characters of its kind.
    Junk(char, Place),
    /// A digit without a second one.
    Half(char, Place),
    /// The line has ended.
    LineEnd,
}

/// Reads hex text one character at a time.
#[derive(Debug)]
pub(crate) struct HexText {
    line: u64,
    column: u64,
    digit: Option<(u8, Place)>,
    in_comment: bool,
    /// Whether the last character was junk: a run of junk is one finding.
    in_junk: bool,
    utf8: Utf8,
}

impl HexText {
    pub(crate) fn new() -> HexText {
        HexText {
            line: 1,
            column: 0,
            digit: None,
            in_comment: false,
            in_junk: false,
            utf8: Utf8::default(),
        }
    }

    /// Takes the next byte of the file; a byte completes two tokens at most.
    pub(crate) fn push(&mut self, byte: u8) -> [Option<HexToken>; 2] {
        match self.utf8.push(byte) {
            Some(character) => self.take(character),
            None => [None, None],
        }
    }

    /// Ends the text.
    pub(crate) fn finish(&mut self) -> Option<HexToken> {
        self.half()
    }

    fn take(&mut self, character: char) -> [Option<HexToken>; 2] {
        self.column += 1;
        let place = Place::Text { line: self.line, column: self.column };
        let in_junk = std::mem::take(&mut self.in_junk);
        if character == '\n' {
            let half = self.half();
            (self.line, self.column, self.in_comment) = (self.line + 1, 0, false);
            return [half, Some(HexToken::LineEnd)];
        }
        if self.in_comment {
            return [None, None];
        }
        match (character, character.to_digit(16)) {
            (_, Some(digit)) => [self.digit(u8::try_from(digit).unwrap_or(0), place), None],
            ('#', _) => {
                self.in_comment = true;
                [self.half(), None]
            }
            ('x' | 'X', _) if matches!(self.digit, Some((0, _))) => {
                self.digit = None;
                [None, None]
            }
            (',', _) => [self.half(), None],
            (blank, _) if blank.is_whitespace() => [self.half(), None],
            (junk, _) => {
                self.digit = None;
                self.in_junk = true;
                [(!in_junk).then_some(HexToken::Junk(junk, place)), None]
            }
        }
    }

    fn digit(&mut self, digit: u8, place: Place) -> Option<HexToken> {
        match self.digit.take() {
            Some((high, place)) => Some(HexToken::Byte(high << 4 | digit, place)),
            None => {
                self.digit = Some((digit, place));
                None
            }
        }
    }

    fn half(&mut self) -> Option<HexToken> {
        let (digit, place) = self.digit.take()?;
        let digit = char::from_digit(digit.into(), 16)?.to_ascii_uppercase();
        Some(HexToken::Half(digit, place))
    }
}

/// Assembles the bytes of a character, so that columns count visible characters.
#[derive(Debug, Default)]
struct Utf8 {
    bytes: [u8; 4],
    len: usize,
}

impl Utf8 {
    fn push(&mut self, byte: u8) -> Option<char> {
        if byte.is_ascii() {
            self.len = 0;
            return Some(char::from(byte));
        }
        if byte >= 0xC0 {
            self.len = 0;
        }
        self.bytes[self.len] = byte;
        self.len += 1;
        let so_far = &self.bytes[..self.len];
        match std::str::from_utf8(so_far) {
            Ok(text) => {
                self.len = 0;
                text.chars().next()
            }
            Err(error) if error.error_len().is_none() => None,
            Err(_) => {
                self.len = 0;
                Some(char::REPLACEMENT_CHARACTER)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &[u8]) -> Vec<String> {
        let mut hex = HexText::new();
        let mut tokens: Vec<_> = text.iter().flat_map(|&byte| hex.push(byte)).flatten().collect();
        tokens.extend(hex.finish());
        tokens
            .into_iter()
            .map(|token| match token {
                HexToken::Byte(byte, _) => format!("{byte:02X}"),
                HexToken::Junk(character, place) => format!("junk {character} {place}"),
                HexToken::Half(digit, place) => format!("half {digit} {place}"),
                HexToken::LineEnd => "end".to_string(),
            })
            .collect()
    }

    #[test]
    fn blanks_commas_prefixes_and_comments_are_allowed() {
        assert_eq!(tokens(b"1B 30\t31,0x34 0X35"), ["1B", "30", "31", "34", "35"]);
        assert_eq!(tokens(b"1b3031 # erase, 99\r\n45"), ["1B", "30", "31", "end", "45"]);
    }

    #[test]
    fn junk_is_named_with_line_and_column_and_takes_its_half_byte_along() {
        assert_eq!(tokens(b"1B\n30 3G 31"), ["1B", "end", "30", "junk G line 2, column 5", "31"]);
        assert_eq!(tokens("1B\u{e4}30".as_bytes()), ["1B", "junk \u{e4} line 1, column 3", "30"]);
        assert_eq!(tokens(b"1B\xFF30"), ["1B", "junk \u{fffd} line 1, column 3", "30"]);
        assert_eq!(
            tokens(b"1B??!30 ?"),
            ["1B", "junk ? line 1, column 3", "30", "junk ? line 1, column 9"]
        );
    }

    #[test]
    fn a_lone_digit_is_named_and_skipped() {
        assert_eq!(tokens(b"1B 3 31"), ["1B", "half 3 line 1, column 4", "31"]);
        assert_eq!(
            tokens(b"1B3\n31c"),
            ["1B", "half 3 line 1, column 3", "end", "31", "half C line 2, column 3"]
        );
    }

    #[test]
    fn no_bytes_make_it_panic() {
        for first in 0..=255 {
            for second in 0..=255 {
                let text: Vec<u8> = [first, second].repeat(3);
                tokens(&text);
            }
        }
    }
}
