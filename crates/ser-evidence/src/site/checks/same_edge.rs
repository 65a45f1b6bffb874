//! An expectation whose two changes are the same.
//!
//! Why: nothing is expected of it.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 recloses"
//! after = "52-1 closed off"
//! then = "52-1 closed off"
//! within_ms = [300, 600]
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[point]]
//! input = 7
//! name = "52-1 closed"
//! [[expect]]
//! name = "52-1 recloses"
//! after = "52-1 closed off"
//! then = "52-1 closed on"
//! within_ms = [300, 600]
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "same-edge";

/// The change at `span` is the one at `after`.
pub(in crate::site) fn found(findings: &mut Findings, span: Span, after: Span) {
    findings.add(
        Diagnostic::error(NAME, span, "a change cannot follow itself")
            .related(after, "the same change")
            .help("name the change that is to follow"),
    );
}
