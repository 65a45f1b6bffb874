//! A number that is negative, or larger than it can be.
//!
//! Why: it is misspelled, or has the wrong unit.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! drift_ppm = -50
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! drift_ppm = 50
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "out-of-range";

/// The number of `key` is not in the range that `range` describes, as in "1 to 32".
pub(in crate::site) fn found(findings: &mut Findings, span: Span, key: &str, range: &str) {
    let diagnostic = Diagnostic::error(NAME, span, format!("`{key}` is out of range"));
    findings.add(diagnostic.label(format!("must be {range}")));
}
