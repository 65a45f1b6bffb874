//! The status table (chapter 5): health of board and bus.

use crate::map;
use crate::ram::SharedRam;

/// Both readings of "bit 1" of the active byte. Some tables count bits from 0 and others from 1;
/// the byte's other bits are not used.
const MONITOR: u8 = 0b0011;

/// Both readings of "bit 3" of the active byte.
const EXCESSIVE_ERRORS: u8 = 0b1100;

/// Scan time of a board that cannot get onto the bus.
const OFF_BUS: u16 = 0xFFFF;

/// The content of the status table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// Software revision of the board.
    pub revision: u8,
    /// Hardware faults, one bit each. A board with any fault has stopped.
    pub faults: u8,
    /// Whether a hand-held monitor is plugged into the motherboard.
    pub monitor: bool,
    /// Whether there were ten or more bus errors within 10 s.
    pub excessive_errors: bool,
    /// Bus errors since power-up, modulo 65536.
    pub bus_errors: u16,
    /// Duration of a bus scan in milliseconds, `None` while the board is not on the bus.
    pub scan_ms: Option<u16>,
}

impl Status {
    /// Whether the board takes part in the bus traffic.
    #[must_use]
    pub const fn on_bus(&self) -> bool {
        self.scan_ms.is_some()
    }

    pub(crate) fn read<R: SharedRam>(ram: &R) -> Status {
        let active = ram.read(map::STATUS_ACTIVE);
        let scan_ms = ram.read_word(map::STATUS_SCAN_TIME);
        Status {
            revision: ram.read(map::STATUS_REVISION),
            faults: ram.read(map::STATUS_FAULTS),
            monitor: active & MONITOR != 0,
            excessive_errors: active & EXCESSIVE_ERRORS != 0,
            bus_errors: ram.read_word(map::STATUS_BUS_ERRORS),
            // The table holds zero from reset to the first scan.
            scan_ms: (scan_ms != OFF_BUS && scan_ms != 0).then_some(scan_ms),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArrayRam;

    #[test]
    fn the_table_is_read_as_chapter_5_has_it() {
        let mut ram = ArrayRam::new();
        ram.write_bytes(0x0892, &[0x21, 1, 0x04, 0x05, 0x34, 0x12, 0x05, 0x00]);
        let expected = Status {
            revision: 0x21,
            faults: 4,
            monitor: true,
            excessive_errors: true,
            bus_errors: 0x1234,
            scan_ms: Some(5),
        };
        assert_eq!(Status::read(&ram), expected);
    }

    #[test]
    fn a_board_off_the_bus_shows_all_ones_and_a_fresh_one_zero() {
        let mut ram = ArrayRam::new();
        assert!(!Status::read(&ram).on_bus());
        ram.write_word(0x0898, 0xFFFF);
        assert!(!Status::read(&ram).on_bus());
        ram.write_word(0x0898, 3);
        assert!(Status::read(&ram).on_bus());
    }

    #[test]
    fn bits_1_and_3_are_found_however_they_are_counted() {
        let read = |active| {
            let mut ram = ArrayRam::new();
            ram.write(0x0895, active);
            let status = Status::read(&ram);
            (status.monitor, status.excessive_errors)
        };
        assert_eq!(read(0x01), (true, false));
        assert_eq!(read(0x02), (true, false));
        assert_eq!(read(0x04), (false, true));
        assert_eq!(read(0x08), (false, true));
    }
}
