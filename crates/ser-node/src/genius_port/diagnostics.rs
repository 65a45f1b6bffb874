//! Counters of what the Genius port ignored, lost or repeated.

use geni_board::{Counters, Failure};

/// Counts since power-up; they stop at the largest value. What was wrong with commands is in
/// [`Diagnostics`](crate::Diagnostics), whichever port they came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeniusDiagnostics {
    /// What the driver has met with at the board.
    pub board: Counters,
    /// How the board failed last.
    pub last_failure: Option<Failure>,
    /// Datagrams that are not for a recorder, or not as they should be.
    pub datagrams_ignored: u32,
    /// Commands that came by broadcast and were carried out.
    pub broadcasts: u32,
    /// Replies that the board could not send, or that went down with it before or after their
    /// commands were carried out.
    pub replies_lost: u32,
    /// Commands that set the clock and were not carried out, because nobody saw them arrive.
    pub clocks_refused: u32,
    /// Auto reports that arrived.
    pub reports_sent: u32,
    /// Auto reports that did not arrive, or of which it is not known; each is sent again.
    pub reports_failed: u32,
}
