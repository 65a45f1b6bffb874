//! Points in a file without a recorder.
//!
//! Why: a point is an input of a recorder. One that is read from files only needs nothing but its
//! name.
//!
//! Bad:
//! ```toml
//! # (no [[recorder]])
//! [[point]]
//! input = 7
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
pub(in crate::site) const NAME: &str = "no-recorder";

/// There are tables of recorders, the first of them `what` at `span`, and no recorders.
pub(in crate::site) fn found(findings: &mut Findings, (span, what): (Span, &str)) {
    findings.add(Diagnostic::error(NAME, span, format!("{what} without any recorder")).help(
        "add `[[recorder]]` with `name = \"SER1\"`; its points may then leave `recorder` out",
    ));
}
