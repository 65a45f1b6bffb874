//! The ports of a recorder, as what judges its replies tells them apart.

/// The port that a command came by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// RS-232.
    Line,
    /// Genius.
    Bus,
}
