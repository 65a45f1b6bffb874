//! A group to which no point belongs. This is a warning.
//!
//! Why: nothing can be first in it. Perhaps the points have yet to be written.
//!
//! Bad:
//! ```toml
//! [[group]]
//! name = "Feeder 1"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[group]]
//! name = "Feeder 1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! group = "Feeder 1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "empty-group";

/// No point belongs to the group `name`.
pub(in crate::site) fn found(findings: &mut Findings, (span, name): (Span, &str)) {
    let phrase = format!("no point belongs to the group {}", quoted(name));
    findings.add(Diagnostic::warning(NAME, span, phrase).help("give its points this `group`"));
}
