//! The log: defmt frames through the debug probe (RTT).
//!
//! # Design
//! A frame goes into a ring that the probe empties while the processor runs. Without a probe, or
//! with a slow one, the ring is full and the rest of the frame is dropped. The log never waits,
//! whatever the probe asks for. No critical section guards it; see `ser_board::log_writer`.
//!
//! # Tradeoffs
//! `defmt-rtt` waits when a probe asks for it, or switches interrupts off. It panics when it is
//! entered twice.
//!
//! # Notes
//! Only `init` and the main loop log. The decoder skips a frame that was cut off, and finds the
//! next one by its delimiter.

use ser_board::log_writer::LogWriter;
use stm32f4::stm32f407::DBGMCU;

use crate::{rtt, timer};

/// Keeps the memory's clock running while the processor sleeps. Otherwise a probe could only read
/// while the processor is awake.
pub(crate) fn start(debug: &DBGMCU) {
    debug.cr().modify(|_, w| w.dbg_sleep().set_bit());
}

defmt::timestamp!("{=u32:ms}", timer::tick_ms());

#[defmt::global_logger]
struct Logger;

static LOG: LogWriter<defmt::Encoder> = LogWriter::new(defmt::Encoder::new());

// SAFETY: `acquire` and `release` may be called from anywhere: see `LogWriter`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        LOG.acquire(rtt::write);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        LOG.release(rtt::write);
    }

    unsafe fn write(bytes: &[u8]) {
        LOG.write(bytes, rtt::write);
    }
}
