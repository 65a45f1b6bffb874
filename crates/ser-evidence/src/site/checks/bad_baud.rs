//! A `baud` that no recorder has.
//!
//! Why: at a rate that is not its own the recorder is silent, and the time of a line is reckoned
//! wrongly.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! baud = 38400
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! baud = 19200
//! ```

use ser_proto::Baud;

use crate::site::diagnostic::{Diagnostic, Findings, Span};

/// The name of this check.
pub(in crate::site) const NAME: &str = "bad-baud";

/// The rate of this many bits per second.
pub(in crate::site) fn rate(findings: &mut Findings, span: &Span, bits: i64) -> Option<Baud> {
    let rate = u32::try_from(bits).ok().and_then(Baud::from_bits_per_second);
    if rate.is_none() {
        let rates = Baud::ALL.map(|baud| baud.bits_per_second().to_string());
        let phrase = format!("no recorder has a rate of {bits} bits per second");
        let diagnostic = Diagnostic::error(NAME, span.clone(), phrase);
        let help = format!("recorders have {}; 9600 as delivered", rates.join(", "));
        findings.add(diagnostic.label("must be the rate of the recorder's port").help(help));
    }
    rate
}
