//! A shift that does not end after it begins.
//!
//! Why: no entry lies in it, and the shift that was meant would not be made.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -250
//! from = "2026-11-22T12:00:00Z"
//! to = "2026-11-22T08:00:00Z"
//! why = "clock found 250 ms fast"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -250
//! from = "2026-11-22T08:00:00Z"
//! to = "2026-11-22T12:00:00Z"
//! why = "clock found 250 ms fast"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "backward-shift";

/// A shift ends, at `to`, before it begins, at `from`.
pub(in crate::site) fn found(findings: &mut Findings, to: Span, from: Span) {
    findings.add(
        Diagnostic::error(NAME, to, "this shift ends before it begins")
            .label("must be later than `from`")
            .related(from, "begins here")
            .help("exchange `from` and `to`; mind the offsets from UTC at their ends"),
    );
}
