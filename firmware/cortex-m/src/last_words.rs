//! The memory that outlives a reset, and the only way to write to it: on the way there.
//!
//! # Notes
//! It is read and written word by word and volatile: nobody gave it a first value, and after a
//! power cut it holds anything. `ser_board` checks what it finds. A power cut that was short may
//! leave it whole.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ptr;

use cortex_m::peripheral::SCB;
use ser_board::last_words::{self, Boot, Fault, Memory, ResetFlag, Text, WORDS};

#[repr(transparent)]
struct Kept(UnsafeCell<MaybeUninit<Memory>>);

// SAFETY: used by `boot`, which runs once and before there are interrupts, and by `end`, which does
// not return: whoever is interrupted by it does not go on, so no two of them are ever at work.
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

/// What is known about the runs before; counts the start. `flag` says why the chip was reset, by
/// the chip's own flags or by what is in the memory.
///
/// # Safety
/// This is called once only, before there are interrupts.
pub unsafe fn boot(flag: impl FnOnce(&Memory) -> ResetFlag) -> Boot {
    with_memory(|memory| {
        let flag = flag(memory);
        last_words::boot(memory, flag)
    })
}

/// Writes the last words and resets the board.
pub fn end(fault: Fault, text: &Text) -> ! {
    with_memory(|memory| last_words::write(memory, fault, text));
    SCB::sys_reset()
}
