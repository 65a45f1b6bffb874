//! A group that no `[[group]]` describes.
//!
//! Why: a misspelled group would be a group of its own, in which something else is first.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! group = "Feeder1"
//! [[group]]
//! name = "Feeder 1"
//! [[point]]
//! input = 8
//! name = "52-1 open"
//! group = "Feeder 1"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! group = "Feeder 1"
//! [[group]]
//! name = "Feeder 1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-group";

/// `name` is none of the groups `known`.
pub(in crate::site) fn found<'n>(
    findings: &mut Findings,
    (span, name): (Span, &str),
    known: impl Iterator<Item = &'n str>,
) {
    let diagnostic = Diagnostic::error(NAME, span, format!("no group is called {}", quoted(name)));
    let help = match nearest(name, known, findings) {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => format!("add `[[group]]` with `name = {}`", in_quotes(name)),
    };
    findings.add(diagnostic.help(help));
}

/// As it is written in a file, without the back quotes.
fn in_quotes(name: &str) -> String {
    quoted(name).replace('`', "\"")
}
