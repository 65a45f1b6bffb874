//! Interrupts to the host (chapter 6).

use std::collections::VecDeque;

use super::Board;
use crate::genius::map::{INTERRUPT_DISABLE, INTERRUPT_STATUS};

/// Why the host may be interrupted. The value is the place in both interrupt tables.
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

/// How many pulses that nobody has asked for are remembered. Of more, only the latest are.
const REMEMBERED: usize = 64;

/// The interrupt pin. It is low for a few microseconds only, so the pulses must be remembered.
#[derive(Clone, Debug, Default)]
pub(super) struct InterruptPin {
    pulses: u64,
    /// When the pulses were that nobody has asked for.
    untaken_us: VecDeque<u64>,
}

impl InterruptPin {
    pub(super) fn pulse(&mut self, now_us: u64) {
        self.pulses += 1;
        if self.untaken_us.len() == REMEMBERED {
            self.untaken_us.pop_front();
        }
        self.untaken_us.push_back(now_us);
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
        !self.take_interrupts().is_empty()
    }

    /// When the board has pulled the interrupt line since this was last asked, in microseconds.
    pub fn take_interrupts(&mut self) -> VecDeque<u64> {
        std::mem::take(&mut self.interrupts.untaken_us)
    }

    /// Sets the condition's flag. Unless the host disabled it, also sets the summary flag and pulls
    /// the line.
    ///
    /// Every occurrence pulls the line, whether or not the host has cleared the flag since the one
    /// before.
    pub(super) fn raise(&mut self, condition: Condition) {
        let index = condition as usize;
        let status = self.ram.get(INTERRUPT_STATUS + index);
        self.ram.set(INTERRUPT_STATUS + index, status | 1);
        if self.is_enabled(condition) {
            let summary = self.ram.get(INTERRUPT_STATUS);
            self.ram.set(INTERRUPT_STATUS, summary | 1);
            self.interrupts.pulse(self.now_us);
        }
    }

    pub(super) fn is_enabled(&self, condition: Condition) -> bool {
        !self.ram.bit0(INTERRUPT_DISABLE) && !self.ram.bit0(INTERRUPT_DISABLE + condition as usize)
    }
}
