//! A number with more decimals than are kept.
//!
//! Why: times are reckoned in whole microseconds, drifts in parts per billion. What is finer would
//! be rounded without a word.
//!
//! Bad:
//! ```toml
//! [host]
//! utc_doubt_ms = 0.0005
//! ```
//! Good:
//! ```toml
//! [host]
//! utc_doubt_ms = 0.001
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "too-fine";

/// The number of `key` has more than three decimals.
pub(in crate::site) fn found(findings: &mut Findings, span: Span, key: &str) {
    let diagnostic = Diagnostic::error(NAME, span, format!("`{key}` is too fine"));
    findings.add(diagnostic.label("at most three decimals are kept"));
}
