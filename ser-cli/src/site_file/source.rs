//! The text of a file as it may be shown, and the places in it.

use ser_console::is_obeyed;
use ser_evidence::site::Span;

/// A text in which everything that a terminal would obey is escaped.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) text: String,
    /// Where places of the original move: from this offset on, to that one.
    moves: Vec<(usize, usize)>,
}

impl Source {
    pub(super) fn of(original: &str) -> Source {
        let (mut text, mut moves) = (String::with_capacity(original.len()), Vec::new());
        let mut letters = original.char_indices().peekable();
        while let Some((at, letter)) = letters.next() {
            let is_line_end = letter == '\r' && matches!(letters.peek(), Some((_, '\n')));
            match letter {
                _ if is_line_end => {}
                '\n' | '\t' => text.push(letter),
                letter if is_obeyed(letter) => text.extend(letter.escape_default()),
                letter => text.push(letter),
            }
            let next = at + letter.len_utf8();
            if is_line_end || (is_obeyed(letter) && !"\n\t".contains(letter)) {
                moves.push((next, text.len()));
            }
        }
        Source { text, moves }
    }

    /// Where a place of the original is in the text.
    pub(super) fn span(&self, original: &Span) -> Span {
        let place = |at: usize| {
            let before = self.moves.partition_point(|(from, _)| *from <= at);
            let moved = before.checked_sub(1).and_then(|index| self.moves.get(index));
            let (from, to) = moved.copied().unwrap_or_default();
            self.boundary(to + (at - from))
        };
        let start = place(original.start);
        start..place(original.end).max(start)
    }

    /// The nearest boundary of characters at or before a place.
    fn boundary(&self, at: usize) -> usize {
        let at = at.min(self.text.len());
        (0..=at).rev().find(|&at| self.text.is_char_boundary(at)).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_stay_at_their_text() {
        let original = "a\u{1B}b = \"c\u{202E}ö\"\r\nnext\u{7}";
        let source = Source::of(original);
        assert_eq!(source.text, "a\\u{1b}b = \"c\\u{202e}ö\"\nnext\\u{7}");
        let shown = |piece: &str| {
            let start = original.find(piece).unwrap();
            &source.text[source.span(&(start..start + piece.len()))]
        };
        assert_eq!(shown("b = "), "b = ");
        assert_eq!(shown("\"c\u{202E}ö\""), "\"c\\u{202e}ö\"");
        assert_eq!(shown("next"), "next");
        assert_eq!(shown("\u{7}"), "\\u{7}");
        assert_eq!(source.span(&(original.len()..original.len())).end, source.text.len());
        // A place that is none is not an error here.
        assert_eq!(source.span(&(1000..2000)), source.text.len()..source.text.len());
    }
}
