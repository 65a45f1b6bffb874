//! An edge whose last word is not `on` or `off`.
//!
//! Why: `after` and `then` are changes of a point, in one direction.
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
//! on = "CLOSED"
//! off = "OPEN"
//! [[expect]]
//! name = "52-1 clears the fault"
//! after = "Relay trip output on"
//! then = "52-1 closed OPEN"
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
//! on = "CLOSED"
//! off = "OPEN"
//! [[expect]]
//! name = "52-1 clears the fault"
//! after = "Relay trip output on"
//! then = "52-1 closed off"
//! within_ms = [15, 50]
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "bad-edge";

/// The text of `key` does not end in `on` or `off`; perhaps `meant` would be right.
pub(in crate::site) fn found(
    findings: &mut Findings,
    (span, text): (Span, &str),
    key: &str,
    meant: Option<String>,
) {
    let phrase = format!("{} does not say in which direction", quoted(text));
    let diagnostic =
        Diagnostic::error(NAME, span, phrase).label("the last word must be `on` or `off`");
    let help = match meant {
        Some(meant) => format!("did you mean {}?", quoted(&meant)),
        None => format!("write it as in `{key} = \"52-1 closed off\"`"),
    };
    findings.add(diagnostic.help(help));
}
