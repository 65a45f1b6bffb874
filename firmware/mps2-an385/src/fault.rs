//! What happens when something goes wrong for good: it is logged, marked for the next boot, and the board resets.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

use crate::external_bus::{self, Fault};
use crate::{log, stack};

/// The watchdog's first time-out has come and the second one has not.
static WATCHDOG_BARKED: AtomicBool = AtomicBool::new(false);

/// The watchdog has been fed after all. True when its first time-out had come.
pub(crate) fn watchdog_fed() -> bool {
    // One context writes `true`, one writes `false`; a bark between the two steps is marked anew by the next one.
    let barked = WATCHDOG_BARKED.load(Ordering::Relaxed);
    if barked {
        WATCHDOG_BARKED.store(false, Ordering::Relaxed);
        external_bus::unmark_fault();
    }
    barked
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    prepare(Fault::Panic);
    // Messages with arguments would bring the formatting machinery with them; the place says enough.
    let message = info.message().as_str().unwrap_or("panic");
    match info.location() {
        Some(place) => defmt::error!("{=str}:{=u32}: {=str}", place.file(), place.line(), message),
        None => defmt::error!("{=str}", message),
    }
    reset()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    if !stack::contains(frame) {
        // There is nothing to read and nothing to stand on: no calls from here. Should the compiler need the stack
        // nevertheless, the processor locks up, and the watchdog resets the board.
        external_bus::mark_fault(Fault::StackOverflow);
        SCB::sys_reset()
    }
    prepare(Fault::Exception);
    // SAFETY: reading the fault status has no side effects.
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    defmt::error!(
        "hard fault {=u32:#010x}: pc {=u32:#010x}, lr {=u32:#010x}",
        status,
        frame.pc(),
        frame.lr()
    );
    reset()
}

/// The watchdog's first time-out. Logging is left to the main loop, which may yet come.
#[exception]
unsafe fn NonMaskableInt() {
    external_bus::mark_fault(Fault::Watchdog);
    WATCHDOG_BARKED.store(true, Ordering::Relaxed);
}

fn prepare(fault: Fault) {
    cortex_m::interrupt::disable();
    external_bus::mark_fault(fault);
    log::take_over();
}

fn reset() -> ! {
    defmt::flush();
    SCB::sys_reset()
}
