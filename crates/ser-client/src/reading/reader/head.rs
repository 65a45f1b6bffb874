//! The head of the log: the place of the next event by the header of the latest reply, and the
//! event in each slot.
//!
//! Events have a running index here, which does not wrap: the unwrapped total of the recorder plus
//! [`BASE`].

use crate::reading::disturbed::Disturbed;
use crate::reading::log_position::LogPosition;

/// The index of total 0, large enough that no difference of indices is negative.
pub(super) const BASE: u64 = 1 << 32;

/// Sequences above this leave the arithmetic no room. No recorder will ever count that far.
const MAX_SEQUENCE: u64 = 1 << 62;

/// The most events between two replies of a reading that are believed: half the range of the total.
/// A recorder needs half a minute for that many, at its fastest.
const MAX_HAPPENED: u64 = 1 << 15;

/// The place of the next event.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    /// Slots of the ring.
    pub(super) size: u64,
    /// Index of the next event.
    pub(super) total: u64,
    /// The slot that it will get.
    pub(super) slot: u64,
    /// How many events came since the reply before.
    pub(super) happened: u64,
}

impl Head {
    /// The head in the first header of a reading. The event `next` is the first that has not been
    /// delivered.
    pub(super) fn first(position: LogPosition, size: u64, next: u64) -> Result<Head, Disturbed> {
        let slot = slot_in_ring(position, size)?;
        let total = next + u64::from(position.total.wrapping_sub(low_16(next)));
        Ok(Head { size, total, slot, happened: 0 })
    }

    /// The head in the next header, if only recording has moved it.
    pub(super) fn moved_to(self, position: LogPosition) -> Result<Head, Disturbed> {
        let slot = slot_in_ring(position, self.size)?;
        let happened = u64::from(position.total.wrapping_sub(low_16(self.total)));
        // A total that went back looks as if almost 65536 events had happened. If that many have
        // indeed happened, a new reading from the cursor resolves that, too.
        if happened > MAX_HAPPENED || slot != (self.slot + happened) % self.size {
            return Err(Disturbed::Changed);
        }
        Ok(Head { total: self.total + happened, slot, happened, ..self })
    }

    /// Whether there are as many entries as events: nothing was overwritten, and no resize has
    /// thrown anything away.
    pub(super) fn holds_all(&self) -> bool {
        low_16(self.total) == low_16(self.slot)
    }

    /// The slot of event `index`, which is at most one ring behind the head.
    pub(super) fn slot_of(&self, index: u64) -> u64 {
        (self.slot + self.size - (self.total - index) % self.size) % self.size
    }

    /// The latest event that went into a slot of the ring.
    pub(super) fn latest_in(&self, slot: u64) -> u64 {
        let age = (self.slot + self.size - slot - 1) % self.size;
        self.total - 1 - age
    }

    /// The oldest event that a full ring holds.
    pub(super) fn oldest(&self) -> u64 {
        self.total.saturating_sub(self.size)
    }

    /// The position as the recorder shows it.
    pub(super) fn position(&self) -> LogPosition {
        LogPosition { total: low_16(self.total), next_slot: low_16(self.slot) }
    }
}

/// The index of the event after the one with this sequence, whatever its value.
pub(super) fn index_after(sequence: u64) -> u64 {
    BASE + sequence.min(MAX_SEQUENCE)
}

#[expect(clippy::cast_possible_truncation, reason = "the low 16 bits are what is wanted")]
pub(super) const fn low_16(value: u64) -> u16 {
    value as u16
}

/// Refuses a slot outside the ring: its size is not the given one, or the ring has just been made
/// larger.
fn slot_in_ring(position: LogPosition, size: u64) -> Result<u64, Disturbed> {
    let slot = u64::from(position.next_slot);
    if slot < size { Ok(slot) } else { Err(Disturbed::WrongSize) }
}
