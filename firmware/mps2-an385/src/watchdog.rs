//! The watchdog.
//!
//! # Design
//! The first time-out only leaves a mark (see `fault.rs`); the second one resets the board. A main loop that is late, but alive,
//! feeds in between and goes on.
//!
//! # Tradeoffs
//! Two seconds each: a recorder that hangs is back after four. Shorter times would reset an emulator whose host is busy.
//!
//! # Notes
//! The first time-out is the non-maskable interrupt. Registers are locked except while feeding, so that a
//! program gone wild is unlikely to switch the watchdog off.

use crate::device::{self, base};
use crate::mmio::Word;

const TIMEOUT_MS: u32 = 2000;

const UNLOCK: u32 = 0x1ACC_E551;
const LOCK: u32 = 0;
const INTERRUPT_AND_RESET_ENABLE: u32 = 0b11;

// SAFETY: AN385 has the watchdog's registers at these addresses.
const LOAD: Word = unsafe { Word::at(base::WATCHDOG) };
// SAFETY: as above.
const CONTROL: Word = unsafe { Word::at(base::WATCHDOG + 0x8) };
// SAFETY: as above.
const INTERRUPT_CLEAR: Word = unsafe { Word::at(base::WATCHDOG + 0xC) };
// SAFETY: as above.
const LOCKING: Word = unsafe { Word::at(base::WATCHDOG + 0xC00) };

/// The running watchdog.
pub(crate) struct Watchdog(());

impl Watchdog {
    /// Starts it; from now on it wants to be fed.
    pub(crate) fn start() -> Watchdog {
        LOCKING.write(UNLOCK);
        LOAD.write(device::CLOCK_HZ / 1000 * TIMEOUT_MS);
        CONTROL.write(INTERRUPT_AND_RESET_ENABLE);
        LOCKING.write(LOCK);
        Watchdog(())
    }

    /// Starts the time anew.
    pub(crate) fn feed(&mut self) {
        LOCKING.write(UNLOCK);
        INTERRUPT_CLEAR.write(1);
        LOCKING.write(LOCK);
    }
}
