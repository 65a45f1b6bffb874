//! An input that the recorder's model does not have.
//!
//! Why: an HE660SER160 has 16 inputs, an HE660SER320 has 32. The point could never change.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! model = "ser160"
//! [[point]]
//! input = 17
//! name = "52-1 closed"
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! model = "ser320"
//! [[point]]
//! input = 17
//! name = "52-1 closed"
//! ```

use crate::site::diagnostic::{Diagnostic, Findings, Span, quoted};

/// The name of this check.
pub(in crate::site) const NAME: &str = "input-beyond-model";

/// `input` is beyond the `inputs` of a recorder whose model is named at `model`.
pub(in crate::site) fn found(
    findings: &mut Findings,
    (span, input): (Span, u8),
    (recorder, inputs): (&str, u8),
    model: Span,
) {
    let phrase = format!("{} has no input {input}", quoted(recorder));
    findings.add(
        Diagnostic::error(NAME, span, phrase)
            .label(format!("must be 1 to {inputs}"))
            .related(model, format!("this model has {inputs} inputs")),
    );
}
