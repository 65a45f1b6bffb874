//! A name or text without a letter.
//!
//! Why: nobody could tell it from others in a report.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = ""
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "empty-text";

/// Whether there is something in the text of `key`.
pub(in crate::site) fn passes(findings: &mut Findings, span: &Span, key: &str, text: &str) -> bool {
    if !text.trim().is_empty() {
        return true;
    }
    let diagnostic = Diagnostic::error(NAME, span.clone(), format!("`{key}` is empty"));
    findings
        .add(diagnostic.help("give it a text, or remove the line where the key may be left out"));
    false
}
