//! Chatter of fewer than three changes.
//!
//! Why: two changes are an operation and its return; they would be folded away as chatter.
//!
//! Bad:
//! ```toml
//! [incident]
//! chatter = { changes = 2, within_ms = 300 }
//! ```
//! Good:
//! ```toml
//! [incident]
//! chatter = { changes = 4, within_ms = 300 }
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "few-changes";

/// The fewest changes that are chatter.
pub(in crate::site) const FEWEST: i64 = 3;

/// Whether so many changes may be called chatter.
pub(in crate::site) fn passes(findings: &mut Findings, span: &Span, changes: i64) -> bool {
    if changes >= FEWEST {
        return true;
    }
    let phrase = "chatter is at least three changes";
    findings.add(
        Diagnostic::error(NAME, span.clone(), phrase)
            .label("must be 3 or more")
            .help("two changes are an operation and its return"),
    );
    false
}
