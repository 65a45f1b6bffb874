//! A name or text with a character that is not shown: a line end, a control character, a mark that
//! sets the direction of text, a blank without width.
//!
//! Why: such characters move a terminal's cursor, make a text read otherwise than it is, or make
//! two names look the same. Letters that are written from right to left are fine.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1\u202ESER1"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use ser_console::is_obeyed;

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "hidden-character";

/// Whether all characters of the text of `key` can be seen.
pub(in crate::site) fn passes(findings: &mut Findings, span: &Span, key: &str, text: &str) -> bool {
    let Some(letter) = text.chars().find(|&letter| is_obeyed(letter) || is_invisible(letter))
    else {
        return true;
    };
    let phrase = format!("`{key}` has a character that is not shown");
    let label = format!("U+{:04X}{}", u32::from(letter), what_it_is(letter));
    let help = "remove it; a name is one line of letters, digits, signs and blanks";
    findings.add(Diagnostic::error(NAME, span.clone(), phrase).label(label).help(help));
    false
}

/// Characters without width. Joiners are not among them: scripts need them.
fn is_invisible(letter: char) -> bool {
    matches!(
        letter,
        '\u{00AD}'
            | '\u{180E}'
            | '\u{200B}'
            | '\u{2060}'..='\u{206F}'
            | '\u{FEFF}'
            | '\u{FFF9}'..='\u{FFFB}'
            | '\u{E0000}'..='\u{E0FFF}'
    )
}

fn what_it_is(letter: char) -> &'static str {
    match letter {
        '\n' | '\r' | '\u{2028}' | '\u{2029}' => ", a line end",
        '\t' => ", a tab",
        '\u{1B}' => ", an escape",
        letter if letter.is_control() => ", a control character",
        letter if is_obeyed(letter) => ", which sets the direction of text",
        _ => ", without width",
    }
}
