//! The text is not TOML.
//!
//! Why: what comes after such a place may be read otherwise than it was meant. All such places are
//! told, not only the first.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings};

/// The name of this check.
pub(in crate::site) const NAME: &str = "syntax";

/// Tells what the parser found. Its places may be empty, and may be missing.
pub(in crate::site) fn told(findings: &mut Findings, text: &str, error: &toml::de::Error) {
    let place = error.span().unwrap_or_default();
    let span = if text.get(place.clone()).is_some() { place } else { text.len()..text.len() };
    let message = error.message();
    let mut diagnostic = Diagnostic::error(NAME, span, message);
    if message.contains("must be quoted") {
        diagnostic = diagnostic.help("write texts between double quotes, as in `\"52-1 closed\"`");
    } else if message == "duplicate key" {
        diagnostic = diagnostic.help("a key stands once in a table; each point, recorder, … begins with its own `[[point]]`, `[[recorder]]`, …");
    }
    findings.add(diagnostic);
}
