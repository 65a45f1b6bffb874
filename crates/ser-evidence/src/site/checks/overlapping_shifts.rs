//! Two shifts of one recorder at the same time.
//!
//! Why: it is not clear whether both are meant, or the later one corrects the earlier.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -250
//! from = "2026-11-22T08:00:00Z"
//! to = "2026-11-22T12:00:00Z"
//! why = "clock found 250 ms fast"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -300
//! from = "2026-11-22T11:00:00Z"
//! to = "2026-11-22T14:00:00Z"
//! why = "clock found 300 ms fast"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -250
//! from = "2026-11-22T08:00:00Z"
//! to = "2026-11-22T11:00:00Z"
//! why = "clock found 250 ms fast"
//! [[shift]]
//! recorder = "U1-SER1"
//! ms = -300
//! from = "2026-11-22T11:00:00Z"
//! to = "2026-11-22T14:00:00Z"
//! why = "clock found 300 ms fast"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "overlapping-shifts";

/// The shift at `span` begins before the one at `other` has ended.
pub(in crate::site) fn found(findings: &mut Findings, (span, recorder): (Span, &str), other: Span) {
    let phrase = format!("two shifts of {} at the same time", quoted(recorder));
    findings.add(
        Diagnostic::error(NAME, span, phrase)
            .related(other, "the other one")
            .help("let the first end where the second begins, or add them up"),
    );
}
