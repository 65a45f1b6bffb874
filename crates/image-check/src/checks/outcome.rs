//! What comes out of a check.

/// What came out of one check of one image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// What is checked.
    pub what: &'static str,
    /// In a few words; empty when the board is not asked.
    pub result: String,
    /// What is wrong, a line each; none when the image keeps to it.
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
