//! Faults that the bench forces, to see what this very image does about them.
//!
//! A word of the external bus says which; it is cleared before it is obeyed, so that the next start
//! is sane. Only the emulated board has such a word.

use core::arch::naked_asm;
use core::hint::black_box;

use cortex_m::peripheral::{NVIC, SCB};

use crate::device::Interrupt;
use crate::external_bus;
use crate::mmio::Word;

/// Where the chip has nothing: reading it is a bus fault.
// SAFETY: a multiple of four, outside of all memory; what reading it does is wanted.
const NOTHING: Word = unsafe { Word::at(0xA000_0000) };

/// Does what the bench wants, if it wants anything. Called in every pass of the main loop.
#[inline]
pub(crate) fn obey() {
    match external_bus::take_forced_fault() {
        0 => {}
        number => force(number),
    }
}

/// In one piece, so that whoever looks for panics and recursion in the image knows where they are
/// meant to be.
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
        // SAFETY: it does not come back, and what it does to the stack nobody sees but the fault
        // handler.
        6 => unsafe { store_below_stack() },
        7 => SCB::sys_reset(),
        _ => {}
    }
}

/// Gets as deep as the stack allows.
#[expect(unconditional_recursion, reason = "it is meant to run out of stack")]
#[inline(never)]
fn recurse(depth: u32) -> u32 {
    // Used after the call, so that this does not become a loop.
    let kept = black_box(depth);
    recurse(kept.wrapping_add(1)).wrapping_add(kept)
}

/// Runs out of stack as a function does that saves many registers at once: nine find no room, and
/// the eight that the processor saves when it takes the fault do.
///
/// # Safety
/// Nobody needs what is in the stack any more.
#[unsafe(naked)]
unsafe extern "C" fn store_below_stack() -> ! {
    naked_asm!(
        // An interrupt in between would be a stack that runs out in another way.
        "cpsid i",
        "movw r0, #:lower16:_stack_end",
        "movt r0, #:upper16:_stack_end",
        "add r0, r0, #32",
        "mov sp, r0",
        "push.w {{r0-r8}}",
        "0: b 0b",
    )
}
