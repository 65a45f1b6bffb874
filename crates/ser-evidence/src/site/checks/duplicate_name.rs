//! Two recorders, two groups, two expectations or two points of one recorder with the same name.
//!
//! Why: the name would no longer say which one is meant.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[recorder]]
//! name = "U1-SER1"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[recorder]]
//! name = "U1-SER2"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "duplicate-name";

/// `what` is called `name`, as the one at `first` is.
pub(in crate::site) fn found(
    findings: &mut Findings,
    (span, name): (Span, &str),
    what: &str,
    first: Span,
) {
    let phrase = format!("two {what} are called {}", quoted(name));
    findings.add(
        Diagnostic::error(NAME, span, phrase)
            .related(first, "first called so here")
            .help("give one of them another name"),
    );
}
