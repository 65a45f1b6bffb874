//! The interrupt tables (chapter 6): which conditions have occurred, and which of them interrupt
//! the host.

use core::ops::BitOr;

use crate::map;
use crate::ram::SharedRam;

/// A set of conditions that can interrupt the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Interrupts(u8);

impl Interrupts {
    /// None.
    pub const NONE: Interrupts = Interrupts(0);
    /// A memory access datagram is in the request queue.
    pub const REQUEST_QUEUE: Interrupts = Interrupts(1 << 0);
    /// A hardware fault or excessive bus errors.
    pub const STATUS: Interrupts = Interrupts(1 << 1);
    /// A device logged in or out or changed its configuration.
    pub const DEVICE: Interrupts = Interrupts(1 << 2);
    /// The board has had its turn on the bus, once per scan.
    pub const OUTPUTS_SENT: Interrupts = Interrupts(1 << 3);
    /// A command is complete.
    pub const COMMAND: Interrupts = Interrupts(1 << 4);
    /// A datagram is in the receive queue.
    pub const RECEIVE_QUEUE: Interrupts = Interrupts(1 << 5);
    /// The tables are locked.
    pub const LOCKOUT: Interrupts = Interrupts(1 << 6);
    /// All seven.
    pub const ALL: Interrupts = Interrupts(0x7F);

    /// Whether all of `other` are in the set.
    #[must_use]
    pub const fn contains(self, other: Interrupts) -> bool {
        self.0 & other.0 == other.0
    }

    /// The set without the members of `other`.
    #[must_use]
    pub const fn without(self, other: Interrupts) -> Interrupts {
        Interrupts(self.0 & !other.0)
    }

    /// Takes and clears the flags that are set. The summary is cleared first, so a flag that is set
    /// meanwhile sets it again.
    pub(crate) fn take<R: SharedRam>(ram: &mut R) -> Interrupts {
        ram.write(map::INTERRUPT_STATUS.at(map::INTERRUPT_SUMMARY), 0);
        let mut taken = Interrupts::NONE;
        for index in 0..map::INTERRUPT_COUNT {
            let flag = map::INTERRUPT_STATUS.at(map::INTERRUPT_FIRST + index);
            if ram.read(flag) & 1 != 0 {
                ram.write(flag, 0);
                taken = taken | Interrupts(1 << index);
            }
        }
        taken
    }

    /// Whether a flag that may interrupt the host is set.
    pub(crate) fn any<R: SharedRam>(ram: &R) -> bool {
        ram.read(map::INTERRUPT_STATUS.at(map::INTERRUPT_SUMMARY)) & 1 != 0
    }

    /// Enables exactly these interrupts.
    pub(crate) fn enable<R: SharedRam>(self, ram: &mut R) {
        for index in 0..map::INTERRUPT_COUNT {
            let disabled = !self.contains(Interrupts(1 << index));
            ram.write(map::INTERRUPT_DISABLE.at(map::INTERRUPT_FIRST + index), disabled.into());
        }
        ram.write(
            map::INTERRUPT_DISABLE.at(map::INTERRUPT_SUMMARY),
            (self == Interrupts::NONE).into(),
        );
    }
}

impl BitOr for Interrupts {
    type Output = Interrupts;

    fn bitor(self, other: Interrupts) -> Interrupts {
        Interrupts(self.0 | other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayRam;

    #[test]
    fn taking_flags_clears_them_and_the_summary() {
        let mut ram = ArrayRam::new();
        assert!(!Interrupts::any(&ram));
        for offset in [0x08A2, 0x08A3, 0x08A8] {
            ram.write(offset, 1);
        }
        assert!(Interrupts::any(&ram));
        assert_eq!(
            Interrupts::take(&mut ram),
            Interrupts::REQUEST_QUEUE | Interrupts::RECEIVE_QUEUE
        );
        assert!((0x08A2..0x08B2).all(|offset| ram.read(offset) == 0));
    }

    #[test]
    fn only_the_low_bit_counts() {
        let mut ram = ArrayRam::new();
        (0x08A2..0x08AA).for_each(|offset| ram.write(offset, 0xFE));
        assert!(!Interrupts::any(&ram));
        assert_eq!(Interrupts::take(&mut ram), Interrupts::NONE);
    }

    #[test]
    fn what_is_not_enabled_is_disabled() {
        let mut ram = ArrayRam::new();
        Interrupts::ALL.without(Interrupts::OUTPUTS_SENT).enable(&mut ram);
        let mut table = [9; 16];
        ram.read_bytes(0x08B2, &mut table);
        assert_eq!(table, [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        Interrupts::NONE.enable(&mut ram);
        ram.read_bytes(0x08B2, &mut table);
        assert_eq!(table, [1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    }
}
