//! What differs between boards.

use crate::genius::scan_time::BusTiming;

/// A board's switches and constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardOptions {
    /// The DIP switches: bits 0–4 bus address, bits 5 and 6 baud rate, bit 7 outputs enabled.
    pub switches: u8,
    /// Revision of the board's software.
    pub revision: u8,
    /// Model number, as other devices see it in a Read ID reply.
    pub model: u8,
    /// How long things take.
    pub timing: Timing,
}

impl BoardOptions {
    /// The usual board with this bus address, at the default rate.
    #[must_use]
    pub fn at(number: u8) -> BoardOptions {
        BoardOptions { switches: 0xE0 | number & 0x1F, ..BoardOptions::default() }
    }

    /// The same board at another rate.
    #[must_use]
    pub fn rate(self, rate: BusTiming) -> BoardOptions {
        BoardOptions { switches: self.switches & !0x60 | rate.dip_switches(), ..self }
    }

    /// The same board with switch 8 set so that the host must enable outputs, device by device.
    #[must_use]
    pub fn outputs_disabled(self) -> BoardOptions {
        BoardOptions { switches: self.switches & !0x80, ..self }
    }
}

impl Default for BoardOptions {
    /// As delivered: all switches open, which is bus address 31 at 153.6 kbaud standard with
    /// outputs enabled.
    fn default() -> Self {
        BoardOptions { switches: 0xFF, revision: 0x21, model: 4, timing: Timing::default() }
    }
}

/// How long a board takes where the manual leaves it open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From reset to the board-OK flag. The manual gives 1.7 to 2 seconds.
    pub ok_after_us: u64,
    /// Until the board looks at what the host has written.
    pub notice_us: u64,
    /// For carrying out a command that needs no bus.
    pub work_us: u64,
}

impl Default for Timing {
    fn default() -> Self {
        Timing { ok_after_us: 1_850_000, notice_us: 200, work_us: 300 }
    }
}
