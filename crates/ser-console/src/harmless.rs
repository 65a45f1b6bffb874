//! The filter for text from outside.

use std::fmt::{self, Display, Write};

/// Shows a text with everything escaped that a terminal would obey instead of showing it: control
/// characters, also those above 7Fh, and what sets the direction of text. Tabs and line ends pass;
/// lines after the first are indented, so that none of them passes for a message of its own.
///
/// ```
/// use ser_console::Harmless;
///
/// assert_eq!(Harmless("a\u{1b}[2Jb").to_string(), r"a\u{1b}[2Jb");
/// assert_eq!(Harmless("no such file: x\nhint: y").to_string(), "no such file: x\n  hint: y");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Harmless<T>(pub T);

impl<T: Display> Display for Harmless<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(Filter { out: f, indent: true }, "{}", self.0)
    }
}

impl<T: Display> Harmless<T> {
    /// The text on a single line: line ends and tabs are escaped, too.
    #[must_use]
    pub fn line(&self) -> String {
        let mut line = String::new();
        for letter in self.0.to_string().chars() {
            if is_obeyed(letter) {
                line.extend(letter.escape_default());
            } else {
                line.push(letter);
            }
        }
        line
    }

    /// The text with its lines as they are, where they are the program's own.
    #[cfg(feature = "arguments")]
    pub(crate) fn lines(&self) -> String {
        let mut lines = String::new();
        // A string takes everything.
        let _ = write!(Filter { out: &mut lines, indent: false }, "{}", self.0);
        lines
    }
}

struct Filter<W> {
    out: W,
    indent: bool,
}

impl<W: Write> Write for Filter<W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars() {
            match letter {
                '\n' if self.indent => self.out.write_str("\n  ")?,
                '\n' | '\t' => self.out.write_char(letter)?,
                letter if is_obeyed(letter) => write!(self.out, "{}", letter.escape_default())?,
                letter => self.out.write_char(letter)?,
            }
        }
        Ok(())
    }
}

/// Whether a terminal does something about this character instead of showing it.
#[must_use]
pub fn is_obeyed(letter: char) -> bool {
    letter.is_control()
        || matches!(
            letter,
            // Marks and overrides of direction, which make text read otherwise than it is; ends of
            // lines and paragraphs.
            '\u{061C}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}'
        )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown_instead() {
        for (text, shown) in [
            ("/dev/ttyUSB0", "/dev/ttyUSB0"),
            ("Prüfstand 7 «ä» 記録", "Prüfstand 7 «ä» 記録"),
            ("\u{1B}[2J\u{1B}]0;title\u{7}", r"\u{1b}[2J\u{1b}]0;title\u{7}"),
            ("\u{9B}2J\u{7F}\u{8}", r"\u{9b}2J\u{7f}\u{8}"),
            ("all is well\rerror", r"all is well\rerror"),
            ("exe\u{202E}gpj", r"exe\u{202e}gpj"),
            ("\u{2066}a\u{2069}\u{200F}\u{2028}", r"\u{2066}a\u{2069}\u{200f}\u{2028}"),
            ("a\tb\nc", "a\tb\n  c"),
        ] {
            assert_eq!(Harmless(text).to_string(), shown);
        }
        assert_eq!(Harmless("a\tb\nc\u{202E}").line(), r"a\tb\nc\u{202e}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn nothing_that_is_obeyed_gets_through(text in any::<String>()) {
            let shown = Harmless(&text).to_string();
            prop_assert!(shown.chars().all(|letter| "\t\n".contains(letter) || !is_obeyed(letter)));
            prop_assert!(!Harmless(&text).line().chars().any(is_obeyed));
            if !text.chars().any(is_obeyed) {
                prop_assert_eq!(shown, text);
            }
        }
    }
}
