//! A recorder that no `[[recorder]]` describes.
//!
//! Why: its name is misspelled, or the recorder is missing.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! recorder = "U1-SER2"
//! input = 7
//! name = "52-1 closed"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! recorder = "U1-SER1"
//! input = 7
//! name = "52-1 closed"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted, quoted_list};
use crate::site::nearest::nearest;

/// The name of this check.
pub(in crate::site) const NAME: &str = "unknown-recorder";

/// `name` is none of the recorders `known`.
pub(in crate::site) fn found<'n>(
    findings: &mut Findings,
    (span, name): (Span, &str),
    known: impl Iterator<Item = &'n str> + Clone,
) {
    let diagnostic =
        Diagnostic::error(NAME, span, format!("no recorder is called {}", quoted(name)));
    let help = match nearest(name, known.clone(), findings) {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => match quoted_list(known.take(SHOWN), "and") {
            names if names.is_empty() => "the file has no `[[recorder]]` yet".to_owned(),
            names => format!("the file has {names}"),
        },
    };
    findings.add(diagnostic.help(help));
}

/// More names than these help nobody.
const SHOWN: usize = 5;
