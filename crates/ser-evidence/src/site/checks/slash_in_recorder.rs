//! A recorder's name with a slash.
//!
//! Why: `RECORDER/POINT` names a point of another recorder. (Names of points may have slashes, as
//! in `50/51 phase A`.)
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1/SER1"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "slash-in-recorder";

/// Whether a recorder's name can stand before a slash.
pub(in crate::site) fn passes(findings: &mut Findings, span: &Span, name: &str) -> bool {
    if !name.contains('/') {
        return true;
    }
    let phrase = "a recorder's name has no slash";
    findings.add(
        Diagnostic::error(NAME, span.clone(), phrase)
            .help(format!("write {}", quoted(&name.replace('/', "-")))),
    );
    false
}
