//! A name or text that begins or ends with a blank.
//!
//! Why: two names that differ in a blank look the same, and one of them cannot be named in `after`
//! and `then`.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1 "
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "padded-text";

/// Whether the text of `key` begins and ends with something that can be seen.
pub(in crate::site) fn passes(findings: &mut Findings, span: &Span, key: &str, text: &str) -> bool {
    if text.trim() == text {
        return true;
    }
    let phrase = format!("`{key}` begins or ends with a blank");
    findings.add(
        Diagnostic::error(NAME, span.clone(), phrase)
            .help(format!("write {}", quoted(text.trim()))),
    );
    false
}
