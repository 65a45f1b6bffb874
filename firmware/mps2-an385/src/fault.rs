//! What happens when something goes wrong for good: it is written down for the next start, and the board resets.
//!
//! # Design
//! Nothing is logged here. The last words are, by the start that follows, which also lays them where the bench can read
//! them.
//!
//! # Tradeoffs
//! A fault costs the log, which is in the memory that nobody can vouch for any more. Recording goes on within
//! milliseconds: a start takes some 62,000 instructions, most of them for clearing that memory (4.0 ms with QEMU's
//! `-icount shift=6`, 64 ns for each; 2–10 ms at the emulator's own speed on a busy computer). The watchdog needs its
//! four seconds first, on this board; see `watchdog`.
//!
//! # Notes
//! The hard fault handler changes to a stack of its own before it does anything, so that a stack that has run out is a
//! fault like any other. The processor's own attempt to save registers there fails as well, and it then enters the handler
//! without them (ARMv7-M architecture, B1.5.11, derived exceptions).

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use ser_board::last_words::{Fault, Text};

use crate::{last_words, stack, watchdog};

/// The last words have been written, and nobody has the last word after that.
static ENDING: AtomicBool = AtomicBool::new(false);

/// The watchdog's first time-out has come and the second one has not.
static WATCHDOG_BARKED: AtomicBool = AtomicBool::new(false);

/// The watchdog has been fed after all. True when its first time-out had come.
pub(crate) fn watchdog_fed() -> bool {
    // The next time-out is a whole period away: nobody writes words while these are taken back.
    let barked = WATCHDOG_BARKED.load(Ordering::Relaxed);
    if barked {
        last_words::withdraw();
        WATCHDOG_BARKED.store(false, Ordering::Relaxed);
    }
    barked
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    end(Fault::Panic, &Text::of_panic(info.location(), info.message().as_str()))
}

/// A time-out of the watchdog: the first one writes down what stands still, the second one resets.
#[exception]
unsafe fn NonMaskableInt() {
    watchdog::acknowledge();
    if ENDING.load(Ordering::Relaxed) {
        return;
    }
    if WATCHDOG_BARKED.load(Ordering::Relaxed) {
        SCB::sys_reset();
    }
    last_words::write(Fault::Watchdog, &Text::from(watchdog::what_stands_still()));
    WATCHDOG_BARKED.store(true, Ordering::Relaxed);
}

const FAULT_STACK_LEN: usize = 1024;

/// For the hard fault handler, and for the non-maskable interrupt on top of it.
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
    // SAFETY: the registers are always there; only their status and address are read, which has no side effects.
    let registers = unsafe { &*SCB::PTR };
    let (status, address) = (registers.cfsr.read(), registers.bfar.read());
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
    cortex_m::interrupt::disable();
    ENDING.store(true, Ordering::Relaxed);
    last_words::write(fault, text);
    SCB::sys_reset()
}
