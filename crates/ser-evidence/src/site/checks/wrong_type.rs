//! A value of another kind than the key takes.
//!
//! Why: `input = "7"` and `input = 7` look alike, and guessing what was meant is not for a record
//! of evidence.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = "7"
//! name = "52-1 closed"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "wrong-type";

/// `key` takes `wanted`, and `found` is there.
pub(in crate::site) fn found(
    findings: &mut Findings,
    span: Span,
    key: &str,
    (wanted, example): (&str, &str),
    found: &str,
) {
    let phrase = format!("`{key}` takes {wanted}, not {found}");
    let diagnostic = Diagnostic::error(NAME, span, phrase).label(format!("this is {found}"));
    findings.add(diagnostic.help(format!("write it as in `{example}`")));
}
