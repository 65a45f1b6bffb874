//! The entry of the hard fault handler.
//!
//! # Design
//! The handler changes to a stack of its own before it does anything else, so that a stack overflow
//! is a fault like any other. The processor's own attempt to save registers on the old stack fails
//! as well, and it then enters the handler without them (ARMv7-M architecture, B1.5.11, derived
//! exceptions).

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;
use ser_board::fault::{Evidence, SavedRegisters};

use crate::stack;

/// Bytes; `cargo xtask firmware` shows how much of them is needed.
#[doc(hidden)]
pub const STACK_LEN: usize = 1024;

/// For the hard fault handler, and for a non-maskable interrupt on top of it.
#[doc(hidden)]
#[repr(C, align(8))]
pub struct FaultStack(UnsafeCell<MaybeUninit<[u8; STACK_LEN]>>);

// SAFETY: only the stack pointer of the hard fault handler ever leads there.
unsafe impl Sync for FaultStack {}

#[doc(hidden)]
#[unsafe(link_section = ".uninit.FAULT_STACK")]
pub static FAULT_STACK: FaultStack = FaultStack(UnsafeCell::new(MaybeUninit::uninit()));

/// What the processor shows. `frame` is where it has saved registers, if there was room for them.
///
/// # Safety
/// Only for the hard fault handler. `frame` must be the stack pointer with which it was entered.
#[doc(hidden)]
pub unsafe fn evidence(frame: *const ExceptionFrame) -> Evidence {
    let saved = stack::contains(frame).then(|| {
        // SAFETY: the processor has put the registers there, and no other code is running.
        let frame = unsafe { &*frame };
        SavedRegisters { pc: frame.pc(), lr: frame.lr() }
    });
    // SAFETY: the registers are always there; only status and addresses are read, which has no side
    // effects.
    let registers = unsafe { &*SCB::PTR };
    #[expect(clippy::cast_possible_truncation, reason = "addresses have 32 bits")]
    let stack_end = stack::end() as u32;
    Evidence {
        saved,
        status: registers.cfsr.read(),
        protected_address: registers.mmfar.read(),
        bus_address: registers.bfar.read(),
        stack_end,
    }
}

/// Makes the image's handler, which calls `end`, a `fn(Fault, &Text) -> !`, with the kind of fault.
#[macro_export]
macro_rules! hard_fault {
    ($end:path) => {
        /// # Safety
        /// Only for the vector table.
        #[unsafe(naked)]
        #[unsafe(no_mangle)]
        unsafe extern "C" fn HardFault() -> ! {
            ::core::arch::naked_asm!(
                "mrs r0, msp",
                "movw r1, #:lower16:({stack} + {len})",
                "movt r1, #:upper16:({stack} + {len})",
                "msr msp, r1",
                "b {hard_fault}",
                stack = sym $crate::hard_fault::FAULT_STACK,
                len = const $crate::hard_fault::STACK_LEN,
                hard_fault = sym hard_fault,
            )
        }

        extern "C" fn hard_fault(frame: *const $crate::ExceptionFrame) -> ! {
            // SAFETY: this is the handler, and that is the stack pointer as it was.
            let evidence = unsafe { $crate::hard_fault::evidence(frame) };
            $end(evidence.fault(), &evidence.text())
        }
    };
}
