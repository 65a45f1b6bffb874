//! A key without which the table says nothing.
//!
//! Why: there is no default that would be right for every plant.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! port = "/dev/ttyUSB0"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! port = "/dev/ttyUSB0"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "missing-key";

/// `table`, whose head is at `span`, lacks `key`.
pub(in crate::site) fn found(
    findings: &mut Findings,
    span: Span,
    table: &str,
    (key, example): (&str, &str),
) {
    let diagnostic = Diagnostic::error(NAME, span, format!("{table} lacks the key `{key}`"));
    findings.add(diagnostic.help(format!("add it, as in `{key} = {example}`")));
}
