//! The result of a check.

/// The result of one check of one image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// What is checked.
    pub what: &'static str,
    /// The result in a few words; empty when the check does not apply to the board.
    pub result: String,
    /// The faults, one line each; empty when the image complies.
    pub wrong: Vec<String>,
}

impl Outcome {
    pub(super) fn new(
        what: &'static str,
        result: impl Into<String>,
        wrong: Vec<String>,
    ) -> Outcome {
        Outcome { what, result: result.into(), wrong }
    }
}
