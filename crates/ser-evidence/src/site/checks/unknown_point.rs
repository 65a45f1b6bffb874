//! A point that no `[[point]]` describes.
//!
//! Why: its name is misspelled, or the point is missing.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 5
//! name = "Relay trip output"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 clears the fault"
//! after = "Relay trip on"
//! then = "52-1 closed off"
//! within_ms = [15, 50]
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 5
//! name = "Relay trip output"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 clears the fault"
//! after = "Relay trip output on"
//! then = "52-1 closed off"
//! within_ms = [15, 50]
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-point";

/// `name` is none of the points `known`.
pub(in crate::site) fn found<'n>(
    findings: &mut Findings,
    (span, name): (Span, &str),
    known: impl Iterator<Item = &'n str>,
) {
    let diagnostic = Diagnostic::error(NAME, span, format!("no point is called {}", quoted(name)));
    let help = match nearest(name, known, findings) {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => "a point is named as in its `name`, or as `RECORDER/NAME`".to_owned(),
    };
    findings.add(diagnostic.help(help));
}
