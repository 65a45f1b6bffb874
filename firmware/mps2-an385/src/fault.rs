//! What happens on a fatal fault: it is written down for the next start, and the board resets.
//!
//! # Design
//! Nothing is logged here. The start that follows logs the last words and puts them where the bench
//! can read them.
//!
//! # Tradeoffs
//! A fault costs the event log, because its memory can no longer be trusted. Recording goes on
//! within milliseconds: a start takes some 62,000 instructions, most of them for clearing that
//! memory (4.0 ms with QEMU's `-icount shift=6`, 64 ns each; 2–10 ms at the emulator's own speed on
//! a busy computer). On this board the watchdog first needs its four seconds; see `watchdog`.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;
use ser_board::last_words::{Boot, Fault, Memory, ResetFlag, Text, is_kept};
use ser_cortex_m::last_words;

use crate::watchdog;

/// The last words are being written. Nothing may write others after them.
static ENDING: AtomicBool = AtomicBool::new(false);

/// The watchdog's first time-out has come and the second one has not.
static WATCHDOG_BARKED: AtomicBool = AtomicBool::new(false);

/// What is known about earlier runs. QEMU reports no cause of a reset, and its memory keeps its
/// content until the emulator ends. Memory that no run has written has therefore been without
/// power.
///
/// # Safety
/// Call once only, before there are interrupts.
pub(crate) unsafe fn boot() -> Boot {
    let flag =
        |memory: &Memory| if is_kept(memory) { ResetFlag::Unknown } else { ResetFlag::PowerOn };
    // SAFETY: promised by the caller.
    unsafe { last_words::boot(flag) }
}

/// Says that the watchdog has been fed. Returns true when its first time-out had already come.
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

/// A time-out of the watchdog. The first one is a warning; the second one writes down what stands
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
