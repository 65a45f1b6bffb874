//! Two points at one input of a recorder.
//!
//! Why: an input is one contact; a change of it would be a change of both.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[point]]
//! input = 7
//! name = "52-1 open"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[point]]
//! input = 8
//! name = "52-1 open"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "duplicate-input";

/// A second point at `input`.
pub(in crate::site) fn found(
    findings: &mut Findings,
    span: Span,
    (input, recorder): (u8, &str),
    first: Span,
) {
    let phrase = format!("two points at input {input} of {}", quoted(recorder));
    findings.add(
        Diagnostic::error(NAME, span, phrase)
            .related(first, "the first one is here")
            .help("a contact that is wired to two recorders is two points with `same_as`"),
    );
}
