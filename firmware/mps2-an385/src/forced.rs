//! Faults that the bench forces, to see how this very image handles them.
//!
//! A word of the external bus selects the fault. It is cleared before the fault happens, so that
//! the next start is sane. Only the emulated board has such a word.

use core::arch::naked_asm;
use core::hint::black_box;

use cortex_m::peripheral::{NVIC, SCB};

use crate::device::Interrupt;
use crate::external_bus;
use crate::mmio::Word;

/// An address where the chip has nothing: reading it is a bus fault.
// SAFETY: a multiple of four, outside of all memory; the fault that a read causes is wanted.
const NOTHING: Word = unsafe { Word::at(0xA000_0000) };

/// Causes the fault that the bench requests, if any. Called in every pass of the main loop.
#[inline]
pub(crate) fn obey() {
    match external_bus::take_forced_fault() {
        0 => {}
        number => force(number),
    }
}

/// Kept in one function, so that a check of the image for panics and recursion knows where they are
/// intended.
#[cold]
#[inline(never)]
fn force(number: u32) {
    match number {
        1 => {
            NOTHING.read();
        }
        2 => loop {
            cortex_m::asm::wfi();
        },
        3 => panic!("forced by the bench"),
        4 => {
            recurse(0);
        }
        5 => NVIC::mask(Interrupt::TIMER0),
        // SAFETY: it does not return, and only the fault handler sees what it does to the stack.
        6 => unsafe { store_below_stack() },
        7 => SCB::sys_reset(),
        _ => {}
    }
}

/// Recurses as deep as the stack allows.
#[expect(unconditional_recursion, reason = "it is meant to run out of stack")]
#[inline(never)]
fn recurse(depth: u32) -> u32 {
    // Used after the call, so that this does not become a loop.
    let kept = black_box(depth);
    recurse(kept.wrapping_add(1)).wrapping_add(kept)
}

/// Overflows the stack as a function does that saves many registers at once. Nine registers find no
/// room, while the eight that the processor saves when it takes the fault do.
///
/// # Safety
/// The content of the stack is no longer needed.
#[unsafe(naked)]
unsafe extern "C" fn store_below_stack() -> ! {
    naked_asm!(
        // An interrupt in between would overflow the stack in another way.
        "cpsid i",
        "movw r0, #:lower16:_stack_end",
        "movt r0, #:upper16:_stack_end",
        "add r0, r0, #32",
        "mov sp, r0",
        "push.w {{r0-r8}}",
        "0: b 0b",
    )
}
