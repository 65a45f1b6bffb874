//! A range whose first number is larger than its second.
//!
//! Why: nothing lies in it.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! delay_ms = { closing = [0.05, 0.01] }
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! delay_ms = { closing = [0.01, 0.05] }
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "upside-down";

/// The range of `key` is upside down.
pub(in crate::site) fn found(findings: &mut Findings, span: Span, key: &str) {
    findings.add(
        Diagnostic::error(NAME, span, format!("`{key}` is upside down"))
            .label("the first number is larger than the second")
            .help(format!("write the smaller one first: `{key} = [SHORTEST, LONGEST]`")),
    );
}
