//! What a reading stands on: why it believes that the next event follows what was delivered.
//!
//! A reading with an anchor looks for it in each reply that should hold it. Once the anchor is
//! overwritten, or where there never was one, the size of the ring has to show that the log is
//! still the same: see `ring`. Delivering an event makes it the new anchor.

use ser_proto::Entry;

/// What the next delivery rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Footing {
    /// Nothing. How many entries the log holds is not known either, and is asked first.
    Unknown,
    /// The anchor: this entry is the last event that was delivered.
    Anchor(Entry),
    /// The total alone: there has never been an anchor.
    Total,
    /// The size of the ring, as the latest reply has shown it.
    RingSize,
    /// The size of the ring, once it is shown again. What was read is kept until then.
    Unconfirmed,
}

impl Footing {
    pub(super) const fn is_anchor(&self) -> bool {
        matches!(self, Footing::Anchor(_))
    }
}
