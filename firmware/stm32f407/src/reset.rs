//! What the chip knows about its resets.

use ser_board::last_words::ResetFlag;
use stm32f4::stm32f407::{FLASH, RCC};

/// Why the chip was reset. Reading clears the flags; the next reset adds its own.
pub(crate) fn take_flag(rcc: &RCC) -> ResetFlag {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // In the order of `ResetFlag`: power-up also sets the brown-out flag, and all resets set that
    // of the pin.
    if flags.porrstf().bit_is_set() {
        ResetFlag::PowerOn
    } else if flags.borrstf().bit_is_set() {
        ResetFlag::BrownOut
    } else if flags.wdgrstf().bit_is_set() || flags.wwdgrstf().bit_is_set() {
        ResetFlag::Watchdog
    } else if flags.sftrstf().bit_is_set() {
        ResetFlag::Software
    } else if flags.padrstf().bit_is_set() {
        ResetFlag::Pin
    } else {
        ResetFlag::Unknown
    }
}

/// Whether the option bytes keep the chip in reset below 2.7 V, as writing the flash requires.
pub(crate) fn guards_brown_out(flash: &FLASH) -> bool {
    const LEVEL_3: u8 = 0b00;
    flash.optcr().read().bor_lev().bits() == LEVEL_3
}
