//! The code that runs from flash, until everything else is in RAM.
//!
//! Out of reset the processor takes its stack and entry from the first two words of the flash.
//! cortex-m-rt's start-up code then copies the image into RAM, vector table included, and calls
//! `main` there; see `ram-image.x`. The first thing that `init` does is to switch to that table.

use core::arch::naked_asm;

use cortex_m::asm;
use cortex_m::peripheral::SCB;

/// One entry of the vector table.
#[repr(C)]
union Vector {
    handler: unsafe extern "C" fn() -> !,
    stack: *const u32,
    reserved: usize,
}

// SAFETY: never written, and what it points to is code and the end of the stack.
unsafe impl Sync for Vector {}

unsafe extern "C" {
    static _stack_start: u32;
    static __vector_table: u32;
    fn Reset() -> !;
}

const NONE: Vector = Vector { reserved: 0 };
const FAULT: Vector = Vector { handler: boot_fault };

/// The vector table until [`use_vectors_in_ram`]. Interrupts are off until then, so any exception
/// is a reset.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".boot_vectors")]
static BOOT_VECTORS: [Vector; 16] = [
    Vector { stack: &raw const _stack_start },
    Vector { handler: Reset },
    FAULT,
    FAULT,
    FAULT,
    FAULT,
    FAULT,
    NONE,
    NONE,
    NONE,
    NONE,
    FAULT,
    FAULT,
    NONE,
    FAULT,
    FAULT,
];

/// The very first step: starts the watchdog with its default time-out of 0.5 s (4096 steps of 4
/// periods of some 32 kHz). From here on, a start that gets stuck is tried again, for instance at a
/// crystal that does not oscillate.
///
/// # Safety
/// Only for the start-up code, before there are variables.
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[unsafe(link_section = ".boot")]
unsafe extern "C" fn __pre_init() {
    // KR of the watchdog, key "start".
    naked_asm!("movw r0, #0x3000", "movt r0, #0x4000", "movw r1, #0xCCCC", "str r1, [r0]", "bx lr")
}

/// # Safety
/// Only for the vector table.
#[unsafe(naked)]
#[unsafe(link_section = ".boot")]
unsafe extern "C" fn boot_fault() -> ! {
    // AIRCR, key and SYSRESETREQ.
    naked_asm!(
        "movw r0, #0xED0C",
        "movt r0, #0xE000",
        "movw r1, #0x0004",
        "movt r1, #0x05FA",
        "str r1, [r0]",
        "0: b 0b",
    )
}

/// Faults and interrupts go to the handlers in RAM from here on.
pub(crate) fn use_vectors_in_ram(scb: &SCB) {
    #[expect(clippy::cast_possible_truncation, reason = "an address of this processor has 32 bits")]
    let table = (&raw const __vector_table).addr() as u32;
    // SAFETY: the table has been copied, and is aligned: ram-image.x does not link otherwise.
    unsafe { scb.vtor.write(table) };
    asm::dsb();
    asm::isb();
}
