//! Interrupts to the host (chapter 6).

use super::Board;
use crate::genius::map::{INTERRUPT_DISABLE, INTERRUPT_STATUS};

/// Why the host may be interrupted; the value is the place in both interrupt tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Condition {
    RequestQueue = 1,
    BoardStatus = 2,
    DeviceStatus = 3,
    OutputsSent = 4,
    CommandComplete = 5,
    ReceiveQueue = 6,
    LockoutGrant = 7,
}

/// The pin is low for a few microseconds only: the host's side must remember that.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InterruptPin {
    pulses: u64,
    taken: u64,
}

impl InterruptPin {
    pub(super) fn pulse(&mut self) {
        self.pulses += 1;
    }
}

impl Board {
    /// How often the board has pulled the interrupt line.
    #[must_use]
    pub fn interrupt_pulses(&self) -> u64 {
        self.interrupts.pulses
    }

    /// Whether the board has pulled the interrupt line since this was last asked.
    pub fn take_interrupt(&mut self) -> bool {
        let pending = self.interrupts.pulses > self.interrupts.taken;
        self.interrupts.taken = self.interrupts.pulses;
        pending
    }

    /// Sets a flag; then, unless the host disabled it, the summary flag, and pulls the line.
    ///
    /// Every occurrence pulls it, whether or not the host has cleared the flag since the one before.
    pub(super) fn raise(&mut self, condition: Condition) {
        let index = condition as usize;
        let status = self.ram.get(INTERRUPT_STATUS + index);
        self.ram.set(INTERRUPT_STATUS + index, status | 1);
        if self.is_enabled(condition) {
            let summary = self.ram.get(INTERRUPT_STATUS);
            self.ram.set(INTERRUPT_STATUS, summary | 1);
            self.interrupts.pulse();
        }
    }

    pub(super) fn is_enabled(&self, condition: Condition) -> bool {
        !self.ram.bit0(INTERRUPT_DISABLE) && !self.ram.bit0(INTERRUPT_DISABLE + condition as usize)
    }
}
