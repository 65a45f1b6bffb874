//! A word that is none of those that the key takes.
//!
//! Why: a role or state that nobody knows would be no role or state at all.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! role = "52c"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! role = "52a"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted, quoted_list};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-word";

/// `word` is none of `words`; perhaps `meant` would be right.
pub(in crate::site) fn found(
    findings: &mut Findings,
    (span, word): (Span, &str),
    key: &str,
    words: &[&str],
    meant: Option<&str>,
) {
    let near = meant.or_else(|| nearest(word, words.iter().copied(), findings));
    let phrase = format!("`{key}` does not know {}", quoted(word));
    let diagnostic = Diagnostic::error(NAME, span, phrase)
        .label(format!("one of {}", quoted_list(words.iter().copied(), "or")));
    findings.add(match near {
        Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
        None => diagnostic,
    });
}
