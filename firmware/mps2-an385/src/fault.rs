//! What happens when something goes wrong for good: it is written down for the next start, and the
//! board resets.
//!
//! # Design
//! Nothing is logged here. The last words are, by the start that follows, which also lays them
//! where the bench can read them.
//!
//! # Tradeoffs
//! A fault costs the log, which is in the memory that nobody can vouch for any more. Recording goes
//! on within milliseconds: a start takes some 62,000 instructions, most of them for clearing that
//! memory (4.0 ms with QEMU's `-icount shift=6`, 64 ns for each; 2–10 ms at the emulator's own
//! speed on a busy computer). The watchdog needs its four seconds first, on this board; see
//! `watchdog`.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;
use ser_board::last_words::{Boot, Fault, Memory, ResetFlag, Text, is_kept};
use ser_cortex_m::last_words;

use crate::watchdog;

/// The last words are being written, and nobody has the last word after that.
static ENDING: AtomicBool = AtomicBool::new(false);

/// The watchdog's first time-out has come and the second one has not.
static WATCHDOG_BARKED: AtomicBool = AtomicBool::new(false);

/// What is known about the runs before. QEMU tells no cause of a reset, and its memory keeps what
/// it holds until the emulator ends: memory that no run has written has been without power.
///
/// # Safety
/// This is called once only, before there are interrupts.
pub(crate) unsafe fn boot() -> Boot {
    let flag =
        |memory: &Memory| if is_kept(memory) { ResetFlag::Unknown } else { ResetFlag::PowerOn };
    // SAFETY: promised by the caller.
    unsafe { last_words::boot(flag) }
}

/// The watchdog has been fed after all. True when its first time-out had come.
pub(crate) fn watchdog_fed() -> bool {
    let barked = WATCHDOG_BARKED.load(Ordering::Relaxed);
    if barked {
        WATCHDOG_BARKED.store(false, Ordering::Relaxed);
    }
    barked
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    end(Fault::Panic, &Text::of_panic(info.location(), info.message().as_str()))
}

/// A time-out of the watchdog: the first one is a warning, the second one writes down what stands
/// still, and resets.
#[exception]
unsafe fn NonMaskableInt() {
    watchdog::acknowledge();
    if ENDING.load(Ordering::Relaxed) {
        return;
    }
    if WATCHDOG_BARKED.load(Ordering::Relaxed) {
        end(Fault::Watchdog, &Text::from(watchdog::what_stands_still()));
    }
    WATCHDOG_BARKED.store(true, Ordering::Relaxed);
}

ser_cortex_m::hard_fault!(end);

fn end(fault: Fault, text: &Text) -> ! {
    cortex_m::interrupt::disable();
    ENDING.store(true, Ordering::Relaxed);
    last_words::end(fault, text)
}
