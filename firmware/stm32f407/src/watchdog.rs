//! The independent watchdog.
//!
//! # Design
//! It has an RC oscillator of its own, which may run at 17–47 kHz (data sheet, "LSI oscillator
//! characteristics"). The time-out is 400 ms at the nominal 32 kHz, 272 ms at least and 753 ms at
//! most. A recorder that hangs is recording again within a second, the start included. The main
//! loop may stay away for the 100 ms that the budget grants it.
//!
//! # Tradeoffs
//! A time-out that covers the erasing of a flash sector (0.5 s) could not keep that second. The
//! erase feeds the watchdog instead, as long as capture makes progress and the erase stays within
//! its time limit; see `flash`.
//!
//! # Notes
//! The chip gives no warning before the watchdog resets it; only the reset flag then tells the
//! cause. `boot` started it before anything else, with its default time-out.

use ser_board::budget::MAIN_LOOP_STALL_MS;
use stm32f4::stm32f407::{DBGMCU, IWDG};

const NOMINAL_MS: u32 = 400;
const NOMINAL_HZ: u32 = 32_000;
const MIN_HZ: u32 = 17_000;
const MAX_HZ: u32 = 47_000;
const DIVIDER: u32 = 16;
#[expect(clippy::cast_possible_truncation, reason = "checked below")]
const RELOAD: u16 = (NOMINAL_HZ / DIVIDER * NOMINAL_MS / 1000 - 1) as u16;

const _: () = {
    let clocks = (RELOAD as u32 + 1) * DIVIDER;
    assert!(RELOAD < 1 << 12);
    assert!(clocks * 1000 / MAX_HZ > 2 * MAIN_LOOP_STALL_MS);
    // Starting takes a tenth of a second at most, see docs/hardware.md.
    assert!(clocks * 1000 / MIN_HZ < 900);
};

const START: u16 = 0xCCCC;
const UNLOCK: u16 = 0x5555;
const FEED: u16 = 0xAAAA;

/// Looks at the transfer of the registers to the slow clock, which takes five of its periods: 0.3
/// ms.
const MAX_LOOKS: u32 = 50_000;

/// The running watchdog. Any copy may feed it.
#[derive(Clone, Copy)]
pub(crate) struct Watchdog(());

impl Watchdog {
    /// Sets the time-out; from now on it must be fed.
    pub(crate) fn start(watchdog: &IWDG, debug: &DBGMCU) -> Watchdog {
        // The watchdog must not reset a processor that a debugger has stopped.
        debug.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        key(watchdog, START);
        key(watchdog, UNLOCK);
        watchdog.pr().write(|w| w.pr().divide_by16());
        watchdog.rlr().write(|w| w.rl().set(RELOAD));
        let _ = (0..MAX_LOOKS).any(|_| watchdog.sr().read().bits() == 0);
        key(watchdog, FEED);
        Watchdog(())
    }

    /// Restarts the time-out.
    pub(crate) fn feed(self) {
        // SAFETY: the key register takes single writes from anywhere.
        key(&unsafe { IWDG::steal() }, FEED);
    }
}

fn key(watchdog: &IWDG, key: u16) {
    // SAFETY: writes any of the keys that the register knows.
    watchdog.kr().write(|w| unsafe { w.bits(key) });
}
