//! The file is larger than 4 MiB.
//!
//! Why: no plant needs that; it is another file, and would take all memory.
//!
//! Bad:
//! ```toml
//! # (more than 4 MiB)
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings};

/// The name of this check.
pub(in crate::site) const NAME: &str = "too-large";

/// The largest text that is read, in bytes.
pub(in crate::site) const LARGEST: usize = 4 << 20;

/// Whether the text is small enough to be read.
pub(in crate::site) fn passes(findings: &mut Findings, text: &str) -> bool {
    if text.len() <= LARGEST {
        return true;
    }
    let phrase = format!("a site file has at most {} MiB", LARGEST >> 20);
    let help = "is this the right file? `ser-cli site new` shows what one looks like";
    findings.add(Diagnostic::error(NAME, 0..0, phrase).help(help));
    false
}
