//! What happens on a fatal fault: it is written down for the next start, and the board resets.
//!
//! # Design
//! Nothing is logged here; the start that follows logs the last words. The log's memory may be what
//! has gone wrong, and a probe that is attached later still finds the last words.

use core::panic::PanicInfo;

use cortex_m_rt::exception;
use ser_board::last_words::{Fault, Text};
use ser_cortex_m::last_words;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    last_words::end(Fault::Panic, &Text::of_panic(info.location(), info.message().as_str()))
}

/// The crystal has stopped. The processor goes on with its RC oscillator, and so will the next
/// start.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    last_words::end(Fault::HardFault, &Text::from("the main crystal has stopped"))
}

ser_cortex_m::hard_fault!(last_words::end);
