//! What outlives a reset, and what the chip knows about it.
//!
//! # Notes
//! The memory is read and written word by word and volatile: nobody gave it a first value, and after a power cut it
//! holds anything. `ser_board` checks what it finds. A brown-out that was short may leave it whole.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ptr;

use ser_board::last_words::{self, Boot, Fault, Memory, ResetFlag, Text, WORDS};
use stm32f4::stm32f407::{FLASH, RCC};

#[repr(transparent)]
struct Kept(UnsafeCell<MaybeUninit<Memory>>);

// SAFETY: `init` uses it before there are interrupts, and a fault on its way to a reset, which nobody interrupts.
unsafe impl Sync for Kept {}

#[unsafe(link_section = ".uninit.LAST_WORDS")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// Reads the memory, lets it be changed, and writes it back.
fn with_memory<T>(change: impl FnOnce(&mut Memory) -> T) -> T {
    let kept: *mut u32 = KEPT.0.get().cast();
    let mut memory = [0; WORDS];
    for (number, word) in memory.iter_mut().enumerate() {
        // SAFETY: inside of the array; any value is a word. See `Kept` for who else might.
        *word = unsafe { ptr::read_volatile(kept.wrapping_add(number)) };
    }
    let result = change(&mut memory);
    for (number, word) in memory.iter().enumerate() {
        // SAFETY: as above.
        unsafe { ptr::write_volatile(kept.wrapping_add(number), *word) };
    }
    result
}

/// What is known about the run before; counts the start. Called once, by `init`.
pub(crate) fn boot(rcc: &RCC) -> Boot {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // In the order of `ResetFlag`: power-up sets the brown-out flag too, and all of them set that of the pin.
    let flag = if flags.porrstf().bit_is_set() {
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
    };
    with_memory(|memory| last_words::boot(memory, flag))
}

/// Writes the last words. Called on the way to a reset, with nobody to interrupt it.
pub(crate) fn write(fault: Fault, text: &Text) {
    with_memory(|memory| last_words::write(memory, fault, text));
}

/// Whether the option bytes keep the chip in reset below 2.7 V, as writing the flash needs it.
pub(crate) fn guards_brown_out(flash: &FLASH) -> bool {
    const LEVEL_3: u8 = 0b00;
    flash.optcr().read().bor_lev().bits() == LEVEL_3
}
