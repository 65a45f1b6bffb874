//! What came of an export.

use ser_evidence::timeline::Item;

/// What was written, and what could not be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counted {
    /// Entries that were written.
    pub entries: u64,
    /// Losses that were written.
    pub losses: u64,
    /// Entries that are not in the file because nothing is known of their time.
    pub timeless: u64,
    /// Changes that are not in the file because the same input changed again in the same row.
    pub hidden: u64,
}

impl Counted {
    /// Counts what is in the list.
    pub(super) fn count(&mut self, item: Item) {
        match item {
            Item::Entry(_) => self.entries += 1,
            Item::Gap(..) => self.losses += 1,
            Item::ClockSet(_) => {}
        }
    }
}
