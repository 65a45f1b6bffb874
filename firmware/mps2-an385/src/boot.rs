//! The very first step after a reset: starts the clock behind the tick.
//!
//! This makes the time that a start takes measurable, including the start-up code that runs before
//! there are variables. The bench reads it on the external bus.

use core::arch::naked_asm;

/// Starts timer 1, which counts down from the top and is never stopped again. `timer` takes it
/// over.
///
/// # Safety
/// Only for the start-up code, before there are variables.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn __pre_init() {
    naked_asm!(
        "movw r0, #0x1000",
        "movt r0, #0x4000",
        "mov r1, #-1",
        // RELOAD, VALUE, then ENABLE in CTRL.
        "str r1, [r0, #8]",
        "str r1, [r0, #4]",
        "movs r1, #1",
        "str r1, [r0]",
        "bx lr",
    )
}
