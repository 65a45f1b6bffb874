//! A name that points of several recorders have.
//!
//! Why: it does not say which one is meant.
//!
//! Bad:
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
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 recloses"
//! after = "52-1 closed off"
//! then = "U1-SER1/52-1 closed on"
//! within_ms = [300, 600]
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
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 recloses"
//! after = "U1-SER1/52-1 closed off"
//! then = "U1-SER1/52-1 closed on"
//! within_ms = [300, 600]
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted, quoted_list};

/// The name of this check.
pub(in crate::site) const NAME: &str = "ambiguous-point";

/// `name` may be any of `full` names; the points are at `places`.
pub(in crate::site) fn found<'n>(
    findings: &mut Findings,
    (span, name): (Span, &str),
    full: impl Iterator<Item = &'n str>,
    places: impl Iterator<Item = Span>,
) {
    let phrase = format!("several points are called {}", quoted(name));
    let help = format!("name the recorder, too: {}", quoted_list(full.take(SHOWN), "or"));
    let diagnostic = Diagnostic::error(NAME, span, phrase).help(help);
    let related = places.take(SHOWN);
    findings.add(
        related.fold(diagnostic, |diagnostic, place| diagnostic.related(place, "one of them")),
    );
}

/// More places than these help nobody.
const SHOWN: usize = 4;
