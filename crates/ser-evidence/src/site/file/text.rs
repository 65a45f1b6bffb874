//! What every text that people read has to keep to.

use toml::Spanned;

use crate::site::checks::{empty_text, hidden_character, long_text, padded_text};
use crate::site::diagnostic::Findings;

/// Tells what is wrong with the text of `key`, which has at most `most` characters.
pub(super) fn look(findings: &mut Findings, text: &Spanned<String>, key: &str, most: usize) {
    let (span, text) = (text.span(), text.get_ref().as_str());
    // One thing is told of each text: a line end at its end is also a blank.
    let _ = empty_text::passes(findings, &span, key, text)
        && hidden_character::passes(findings, &span, key, text)
        && padded_text::passes(findings, &span, key, text)
        && long_text::passes(findings, &span, (key, most), text);
}
