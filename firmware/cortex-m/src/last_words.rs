//! The memory that outlives a reset. A program writes to it only at start-up and on the way to a
//! reset.
//!
//! # Notes
//! The memory is read and written word by word and volatile: it has no first value, and after a
//! power cut it holds anything. `ser_board` checks what it finds. A short power cut may leave it
//! intact.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ptr;

use cortex_m::peripheral::SCB;
use ser_board::last_words::{self, Boot, Fault, Memory, ResetFlag, Text, WORDS};

#[repr(transparent)]
struct Kept(UnsafeCell<MaybeUninit<Memory>>);

// SAFETY: used by `boot`, which runs once and before there are interrupts, and by `end`, which does
// not return. Whatever `end` interrupts never continues, so no two of them are ever at work.
unsafe impl Sync for Kept {}

#[unsafe(link_section = ".uninit.LAST_WORDS")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// Reads the memory, lets it be changed, and writes it back.
fn with_memory<T>(change: impl FnOnce(&mut Memory) -> T) -> T {
    let kept: *mut u32 = KEPT.0.get().cast();
    let mut memory = [0; WORDS];
    for (number, word) in memory.iter_mut().enumerate() {
        // SAFETY: inside the array; any value is a word. See `Kept` for other users.
        *word = unsafe { ptr::read_volatile(kept.wrapping_add(number)) };
    }
    let result = change(&mut memory);
    for (number, word) in memory.iter().enumerate() {
        // SAFETY: as above.
        unsafe { ptr::write_volatile(kept.wrapping_add(number), *word) };
    }
    result
}

/// What is known about earlier runs; counts the start. `flag` says why the chip was reset, from the
/// chip's own flags or from the content of the memory.
///
/// # Safety
/// Call once only, before there are interrupts.
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
