//! A point that reads the same on and off.
//!
//! Why: a report would not say what happened.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! on = "CLOSED"
//! off = "CLOSED"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! on = "CLOSED"
//! off = "OPEN"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "same-texts";

/// The texts for off, at `span`, and on, at `on`, are the same.
pub(in crate::site) fn found(findings: &mut Findings, span: Span, on: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "the texts for on and off are the same")
            .related(on, "the same text")
            .help("give each state its own text, such as CLOSED and OPEN"),
    );
}
