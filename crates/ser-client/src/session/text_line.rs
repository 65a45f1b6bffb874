//! Lines of text between the frames: what a recorder prints. Lines are bounded. Bytes that are not
//! text are counted and left out.

/// The most characters of a line that are kept.
pub const MAX_LINE_LEN: usize = 320;

/// One line, without its end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextLine {
    /// The printable ASCII characters of the line.
    pub text: String,
    /// Whether the line was longer than [`MAX_LINE_LEN`] and the rest is missing.
    pub cut: bool,
    /// How many bytes of the line are not text, including the remains of broken frames. They are
    /// not in `text`; a line that has some is damaged.
    pub noise: u32,
}

/// Assembles lines from single bytes. A line ends with LF; a CR before it is dropped.
#[derive(Clone, Debug, Default)]
pub struct LineAssembler {
    line: TextLine,
    /// A CR, which belongs to the line end if LF follows and is noise otherwise.
    pending_cr: bool,
}

impl LineAssembler {
    /// Takes the next byte and returns the line that it completes. Empty lines are dropped.
    pub fn push(&mut self, byte: u8) -> Option<TextLine> {
        if self.pending_cr && byte != b'\n' {
            self.damaged();
        }
        self.pending_cr = byte == b'\r';
        match byte {
            b'\n' => {
                let line = std::mem::take(&mut self.line);
                return (line != TextLine::default()).then_some(line);
            }
            b'\r' => {}
            b'\t' | b' '..=b'~' if self.line.text.len() < MAX_LINE_LEN => {
                self.line.text.push(char::from(byte));
            }
            b'\t' | b' '..=b'~' => self.line.cut = true,
            _ => self.damaged(),
        }
        None
    }

    /// Notes that something was lost in the current line.
    pub fn damaged(&mut self) {
        self.line.noise = self.line.noise.saturating_add(1);
    }

    /// Forgets the current line.
    pub fn clear(&mut self) {
        *self = LineAssembler::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<TextLine> {
        let mut assembler = LineAssembler::default();
        bytes.iter().filter_map(|&byte| assembler.push(byte)).collect()
    }

    fn clean(text: &str) -> TextLine {
        TextLine { text: text.to_owned(), cut: false, noise: 0 }
    }

    #[test]
    fn cr_lf_and_lf_end_a_line_and_empty_lines_are_dropped() {
        assert_eq!(lines(b"one\r\n\r\ntwo\n\nthr"), [clean("one"), clean("two")]);
    }

    #[test]
    fn bytes_that_are_no_text_are_counted() {
        assert_eq!(
            lines(b"a\xFFb\0c\rd\n\xF0\xF0\n"),
            [TextLine { noise: 3, ..clean("abcd") }, TextLine { noise: 2, ..clean("") }]
        );
    }

    #[test]
    fn a_line_without_end_is_cut_and_takes_no_more_memory() {
        let mut assembler = LineAssembler::default();
        for _ in 0..100_000 {
            assert_eq!(assembler.push(b'x'), None);
        }
        let line = assembler.push(b'\n').unwrap();
        assert_eq!((line.text.len(), line.cut, line.noise), (MAX_LINE_LEN, true, 0));
        assert!(line.text.capacity() <= 2 * MAX_LINE_LEN);
        assert_eq!(assembler.push(b'\n'), None);
    }
}
