//! A name of more than 200 characters; of a port or a reason, of more than 1000.
//!
//! Why: it would fill a screen wherever it is shown.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1 and so on, for ever …"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "long-text";

/// Whether the text of `key` has at most `most` characters.
pub(in crate::site) fn passes(
    findings: &mut Findings,
    span: &Span,
    (key, most): (&str, usize),
    text: &str,
) -> bool {
    let count = text.chars().count();
    if count <= most {
        return true;
    }
    let diagnostic = Diagnostic::error(NAME, span.clone(), format!("`{key}` is too long"));
    findings.add(diagnostic.label(format!("{count} characters; at most {most}")));
    false
}
