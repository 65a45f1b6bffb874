//! What happens when something goes wrong for good: it is written down for the next start, and the board resets.
//!
//! # Design
//! Nothing is logged here. The last words are, by the start that follows: the log's memory may be what has gone wrong, and
//! a probe that comes later finds them too.
//!
//! # Notes
//! The hard fault handler changes to a stack of its own before it does anything, so that a stack that has run out is a
//! fault like any other. The processor's own attempt to save registers there fails as well, and it then enters the handler
//! without them (ARMv7-M architecture, B1.5.11, derived exceptions).

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use ser_board::last_words::{Fault, Text};

use crate::{last_words, stack};

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    end(Fault::Panic, &Text::of_panic(info.location(), info.message().as_str()))
}

/// The crystal has stopped; the processor goes on with its RC oscillator, and so will the next start.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    end(Fault::HardFault, &Text::from("the main crystal has stopped"))
}

const FAULT_STACK_LEN: usize = 1024;

/// For the hard fault handler; it needs half of it.
#[repr(C, align(8))]
struct FaultStack(UnsafeCell<MaybeUninit<[u8; FAULT_STACK_LEN]>>);

// SAFETY: only the stack pointer of the hard fault handler ever leads there.
unsafe impl Sync for FaultStack {}

#[unsafe(link_section = ".uninit.FAULT_STACK")]
static FAULT_STACK: FaultStack = FaultStack(UnsafeCell::new(MaybeUninit::uninit()));

/// # Safety
/// For the vector table.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "movw r1, #:lower16:({stack} + {len})",
        "movt r1, #:upper16:({stack} + {len})",
        "msr msp, r1",
        "b {hard_fault}",
        stack = sym FAULT_STACK,
        len = const FAULT_STACK_LEN,
        hard_fault = sym hard_fault,
    )
}

/// With what the processor has saved on the stack in use, if there was room for it.
extern "C" fn hard_fault(frame: *const ExceptionFrame) -> ! {
    if !stack::contains(frame) {
        end(Fault::StackOverflow, &Text::EMPTY);
    }
    // SAFETY: the processor has put it there, and nobody else is at work.
    let frame = unsafe { &*frame };
    // SAFETY: reading the fault status and the fault address has no side effects.
    let scb = unsafe { &*SCB::PTR };
    let (status, address) = (scb.cfsr.read(), scb.mmfar.read());
    let mut text = Text::EMPTY;
    for (name, value) in
        [("pc ", frame.pc()), (" lr ", frame.lr()), (" status ", status), (" address ", address)]
    {
        text.push_str(name);
        text.push_hex(value);
    }
    end(Fault::HardFault, &text)
}

fn end(fault: Fault, text: &Text) -> ! {
    last_words::write(fault, text);
    SCB::sys_reset()
}
