//! Two recorders at the same port.
//!
//! Why: a recorder is found by its port; here one of two names would win.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! port = "/dev/ttyUSB0"
//! [[recorder]]
//! name = "U1-SER2"
//! port = "/dev/ttyUSB0"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! port = "/dev/ttyUSB0"
//! [[recorder]]
//! name = "U1-SER2"
//! port = "/dev/ttyUSB1"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "duplicate-port";

/// A second recorder at `port`.
pub(in crate::site) fn found(findings: &mut Findings, (span, port): (Span, &str), first: Span) {
    let phrase = format!("two recorders at the port {}", quoted(port));
    findings.add(
        Diagnostic::error(NAME, span, phrase).related(first, "first used here").help(
            "recorders on one Genius bus differ in `?node=`, as in `geni:/dev/shm/host?node=5`",
        ),
    );
}
