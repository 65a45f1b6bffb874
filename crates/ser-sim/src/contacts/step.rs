//! A contact that moves.

/// One contact moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Step {
    /// When, in milliseconds from the start of the scenario.
    pub at_ms: u64,
    /// Which input, from 1.
    pub input: u8,
    /// Whether the contact closes.
    pub on: bool,
}
