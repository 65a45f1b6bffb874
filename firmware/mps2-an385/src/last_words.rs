//! What outlives a reset.
//!
//! # Notes
//! The memory is read and written word by word and volatile: nobody gave it a first value. QEMU tells no cause of a
//! reset, and its memory keeps what it holds until the emulator ends: memory that no run has written has been without
//! power.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::ptr;

use ser_board::last_words::{self, Boot, Fault, Memory, ResetFlag, Text, WORDS};

#[repr(transparent)]
struct Kept(UnsafeCell<MaybeUninit<Memory>>);

// SAFETY: `init` uses it before there are interrupts; after that, whoever is on the way to a reset, or the watchdog's
// interrupt and the main loop, never one inside the other: see `fault`.
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

/// What is known about the run before. Called once, by `init`.
pub(crate) fn boot() -> Boot {
    with_memory(|memory| {
        let flag = if last_words::is_kept(memory) { ResetFlag::Unknown } else { ResetFlag::PowerOn };
        last_words::boot(memory, flag)
    })
}

/// Writes the last words.
pub(crate) fn write(fault: Fault, text: &Text) {
    with_memory(|memory| last_words::write(memory, fault, text));
}

/// Takes them back: it did not come to a reset.
pub(crate) fn withdraw() {
    with_memory(last_words::withdraw);
}
