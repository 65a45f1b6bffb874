//! The text is not TOML.
//!
//! Why: what comes after such a place may be read otherwise than it was meant. All such places are
//! told, not only the first.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings};

/// The name of this check.
pub(in crate::site) const NAME: &str = "syntax";

/// Tells what the parser found. Its places may be empty, and may be missing.
pub(in crate::site) fn told(findings: &mut Findings, text: &str, error: &toml::de::Error) {
    let place = error.span().unwrap_or_default();
    let span = if text.get(place.clone()).is_some() { place } else { text.len()..text.len() };
    let message = error.message();
    let is_unquoted = message.starts_with(UNQUOTED);
    let (phrase, help) = match message {
        _ if is_unquoted && span.is_empty() => ("no value after `=`", Some(NO_VALUE)),
        _ if is_unquoted => ("this is no value", Some(QUOTES)),
        "duplicate key" => ("this key stands twice in its table", Some(TWICE)),
        message => (message, None),
    };
    let diagnostic = Diagnostic::error(NAME, span, phrase);
    findings.add(help.into_iter().fold(diagnostic, Diagnostic::help));
}

/// How the parser begins when it meets something that is neither a number nor a text.
const UNQUOTED: &str = "string values must be quoted";

const NO_VALUE: &str = "write a value, or remove the line";

const QUOTES: &str = "write texts between double quotes, as in `\"52-1 closed\"`";

const TWICE: &str = "remove one of the two; each point begins with its own `[[point]]`, each recorder \
                     with its own `[[recorder]]`";
