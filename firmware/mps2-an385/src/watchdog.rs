//! The watchdog.
//!
//! # Design
//! The first time-out is the non-maskable interrupt, which only notes it (see `fault`). The second
//! one writes the last words and resets the board. A main loop that is late but alive feeds the
//! watchdog in between and continues.
//!
//! # Tradeoffs
//! Two seconds for each time-out: a recorder that hangs is back after four. Shorter times would
//! reset an emulator whose host is busy.
//!
//! # Notes
//! The interrupt is a level that stays until it is cleared. It is not specified whether a processor
//! takes a non-maskable interrupt again while its level stays. The handler therefore clears it, and
//! the second interrupt resets. Clearing it begins a new period. A processor that takes no
//! interrupt at all does not clear it either; the watchdog itself then resets it at the second
//! time-out. (Cortex-M System Design Kit, "APB watchdog".) Registers are locked except while they
//! are written, so that a runaway program is unlikely to switch the watchdog off.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::device::{self, base};
use crate::mmio::Word;
use crate::timer;

/// Length of each time-out.
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

/// The tick at which the watchdog was fed last.
static FED_MS: AtomicU32 = AtomicU32::new(0);

/// The running watchdog.
pub(crate) struct Watchdog(());

impl Watchdog {
    /// Starts it; from now on it must be fed.
    pub(crate) fn start() -> Watchdog {
        LOCKING.write(UNLOCK);
        LOAD.write(device::CLOCK_HZ / 1000 * TIMEOUT_MS);
        CONTROL.write(INTERRUPT_AND_RESET_ENABLE);
        LOCKING.write(LOCK);
        Watchdog(())
    }

    /// Restarts the time-out; `now_ms` is the tick of the latest sample.
    pub(crate) fn feed(&mut self, now_ms: u32) {
        FED_MS.store(now_ms, Ordering::Relaxed);
        acknowledge();
    }
}

/// Clears the interrupt, which also restarts the time-out. A call that interrupts another one has
/// already done the other's work.
pub(crate) fn acknowledge() {
    LOCKING.write(UNLOCK);
    INTERRUPT_CLEAR.write(1);
    LOCKING.write(LOCK);
}

/// The half of the recorder that has made no progress since the watchdog was fed.
pub(crate) fn what_stands_still() -> &'static str {
    if timer::tick_ms() == FED_MS.load(Ordering::Relaxed) {
        "capture stands still"
    } else {
        "the main loop stands still"
    }
}
