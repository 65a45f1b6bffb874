//! Text between frames, one line at a time.

use ser_client::MAX_LINE_LEN;

use super::{Kind, Place};

/// A run of bytes between frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Line {
    /// Where it starts.
    pub(crate) place: Place,
    /// Text, or noise if it contains a byte that no printer prints.
    pub(crate) kind: Kind,
    /// Printable ASCII as it is, everything else as `\x1f`, because a capture must not be able to
    /// control the terminal.
    pub(crate) text: String,
}

/// Collects bytes until a line is complete.
#[derive(Debug, Default)]
pub(crate) struct LineAssembler {
    line: Vec<u8>,
    start: Option<Place>,
}

impl LineAssembler {
    /// Takes the byte at `place`; returns the line that it completes.
    pub(crate) fn push(&mut self, byte: u8, place: Place) -> Option<Line> {
        if byte == b'\n' {
            return self.finish();
        }
        self.start.get_or_insert(place);
        self.line.push(byte);
        // A capture without line ends must not take more memory than one with them.
        if self.line.len() >= MAX_LINE_LEN { self.finish() } else { None }
    }

    /// Ends the line; an empty one does not count.
    pub(crate) fn finish(&mut self) -> Option<Line> {
        let place = self.start.take()?;
        let bytes = std::mem::take(&mut self.line);
        let bytes = bytes.strip_suffix(b"\r").unwrap_or(&bytes);
        let is_text = |&byte: &u8| byte == b'\t' || (b' '..=b'~').contains(&byte);
        let kind = if bytes.iter().all(is_text) { Kind::Text } else { Kind::Noise };
        let shown = |&byte: &u8| match byte {
            b' '..=b'~' => char::from(byte).to_string(),
            other => other.escape_ascii().to_string(),
        };
        (!bytes.is_empty()).then(|| Line { place, kind, text: bytes.iter().map(shown).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<String> {
        let mut assembler = LineAssembler::default();
        let mut lines: Vec<_> = (0..)
            .zip(text)
            .filter_map(|(at, &byte)| assembler.push(byte, Place::Offset(at)))
            .collect();
        lines.extend(assembler.finish());
        lines
            .into_iter()
            .map(|line| format!("{:?} {}: {}", line.kind, line.place, line.text))
            .collect()
    }

    #[test]
    fn lines_are_given_with_the_place_where_they_start() {
        assert_eq!(lines(b"one\r\n\r\ntwo"), ["Text byte 0: one", "Text byte 7: two"]);
    }

    #[test]
    fn what_does_not_print_is_escaped_and_what_does_not_end_is_cut() {
        assert_eq!(lines(b"\x00\xFF'\"\\\t\x07\n"), ["Noise byte 0: \\x00\\xff'\"\\\\t\\x07"]);
        let cut: Vec<_> =
            lines(&[b'A'; 600]).iter().map(|line| line.matches('A').count()).collect();
        assert_eq!(cut, [320, 280]);
    }
}
