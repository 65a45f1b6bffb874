//! What people should know about the clocks.

use super::links::LinkReason;
use crate::record::Boot;

/// Something about clocks that people should know.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finding {
    /// Two observations of one run cannot both be true. What either of them allows is used.
    Contradiction {
        /// The recorder, by its index in the history.
        recorder: usize,
        /// What the clock showed at either.
        shown: [i64; 2],
    },
    /// It cannot be said to which run of the clock an observation belongs, so it is not used.
    NotPlaced {
        /// The recorder, by its index in the history.
        recorder: usize,
        /// What the clock showed.
        shown: i64,
    },
    /// A link between two recorders contradicts what is known otherwise, so it is not used.
    WrongLink {
        /// The recorders, by their indices in the history.
        recorders: [usize; 2],
        /// What linked them.
        why: LinkReason,
    },
    /// The clock of an observing host was set meanwhile. What either of its readings allows is
    /// used.
    HostStepped(Boot),
}
