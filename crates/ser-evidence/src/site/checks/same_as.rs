//! A `same_as` that cannot be: the point itself, a point of the same recorder, or a point that is
//! paired with another one.
//!
//! Why: it says that one contact is wired to two recorders. It is enough to say so on one side; two
//! sides that say different things cannot both be right.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[point]]
//! input = 8
//! name = "52-1 open"
//! same_as = "52-1 closed"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[recorder]]
//! name = "U1-SER2"
//! [[point]]
//! recorder = "U1-SER1"
//! input = 7
//! name = "52-1 closed"
//! [[point]]
//! recorder = "U1-SER2"
//! input = 8
//! name = "52-1 open"
//! same_as = "U1-SER1/52-1 closed"
//! inverted = true
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "same-as";

/// The point at `target` is this point itself.
pub(in crate::site) fn itself(findings: &mut Findings, span: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "a point is not the same contact as itself")
            .help("name the point of the other recorder, as in `U1-SER2/52-1 closed`"),
    );
}

/// The point at `target` is on the same recorder.
pub(in crate::site) fn own_recorder(findings: &mut Findings, span: Span, target: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "both points are on the same recorder")
            .related(target, "the other point")
            .help("`same_as` is for a contact that is wired to two recorders"),
    );
}

/// The point at `target` is paired, at `there`, with a third one.
pub(in crate::site) fn taken(findings: &mut Findings, span: Span, target: &str, there: Span) {
    let phrase = format!("{} is paired with another point", quoted(target));
    findings.add(
        Diagnostic::error(NAME, span, phrase)
            .related(there, "paired here")
            .help("a contact is at most on two recorders here; remove one of the two `same_as`"),
    );
}

/// One side says `inverted = true`, and the other, at `there`, the contrary.
pub(in crate::site) fn inverted_here_only(findings: &mut Findings, span: Span, there: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "the two points disagree about `inverted`")
            .related(there, "says the contrary")
            .help("say it on one side only"),
    );
}

/// `inverted` of a point that is paired with none.
pub(in crate::site) fn inverted_alone(findings: &mut Findings, span: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "`inverted` says nothing without `same_as`")
            .help("add `same_as`, or, for a contact that is on when the equipment is off, exchange the texts `on` and `off`"),
    );
}
