//! How a reading knows that the next event follows what was delivered.
//!
//! A reading with an anchor looks for it in each reply that should hold it. If the anchor is
//! overwritten or there never was one, the size of the ring must show that the log is still the
//! same: see `ring`. A delivered event becomes the new anchor.

use ser_proto::Entry;

/// What the next delivery rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Footing {
    /// Nothing. The number of entries in the log is unknown, too, and is asked first.
    Unknown,
    /// The anchor: this entry is the last event that was delivered.
    Anchor(Entry),
    /// The total alone, because there has never been an anchor.
    Total,
    /// The size of the ring, as the latest reply has shown it.
    RingSize,
    /// The size of the ring, once it is shown again. Entries are kept until then.
    Unconfirmed,
}

impl Footing {
    pub(super) const fn is_anchor(&self) -> bool {
        matches!(self, Footing::Anchor(_))
    }
}
