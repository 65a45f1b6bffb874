//! Counters of what the Genius port ignored, lost or repeated.

use geni_board::{Counters, Failure};

/// Counts since power-up; they stop at the largest value. Faulty commands are counted in
/// [`Diagnostics`](crate::Diagnostics), whichever port they came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GeniusDiagnostics {
    /// What the driver has counted at the board.
    pub board: Counters,
    /// How the board failed last.
    pub last_failure: Option<Failure>,
    /// Datagrams that are not for a recorder, or are malformed.
    pub datagrams_ignored: u32,
    /// Commands that came by broadcast and were carried out.
    pub broadcasts: u32,
    /// Replies that the board could not send, or that were lost when it failed, before or after
    /// their commands were carried out.
    pub replies_lost: u32,
    /// Set-clock commands that were not carried out, and marks that were not kept, because the time
    /// of their arrival is not known.
    pub clocks_refused: u32,
    /// Auto reports that arrived.
    pub reports_sent: u32,
    /// Auto reports that did not arrive, or whose arrival is not known. Each is sent again.
    pub reports_failed: u32,
}

impl GeniusDiagnostics {
    /// Those of the port itself, in the order of the fields.
    pub(crate) const fn all(&self) -> [u32; 6] {
        [
            self.datagrams_ignored,
            self.broadcasts,
            self.replies_lost,
            self.clocks_refused,
            self.reports_sent,
            self.reports_failed,
        ]
    }
}
