//! The log: defmt frames through the debug probe (RTT).
//!
//! # Design
//! A frame goes into a ring that the probe empties while the processor runs. Without a probe, or
//! with one that is slow, the ring is full and the rest of the frame is dropped: the log never
//! waits, whatever the probe asks for. No critical section guards it, so that it never delays the
//! capture interrupt: whoever interrupts a record that is being written writes nothing.
//!
//! # Tradeoffs
//! `defmt-rtt` waits when a probe asks for it, or switches interrupts off, and panics when it is
//! entered twice.
//!
//! # Notes
//! Only `init` and the main loop log. A frame that was cut off is skipped by the decoder, which
//! finds the next one at its delimiter.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use stm32f4::stm32f407::DBGMCU;

use crate::{rtt, timer};

/// Keeps the memory's clock running while the processor sleeps: else a probe could only look when
/// it is awake.
pub(crate) fn start(debug: &DBGMCU) {
    debug.cr().modify(|_, w| w.dbg_sleep().set_bit());
}

defmt::timestamp!("{=u32:ms}", timer::tick_ms());

#[defmt::global_logger]
struct Logger;

struct SharedEncoder(UnsafeCell<defmt::Encoder>);

// SAFETY: touched only while `DEPTH` is 1, that is by the one whose `acquire` found 0. Contexts
// nest: one that interrupts it has released the log again before it goes on.
unsafe impl Sync for SharedEncoder {}

static ENCODER: SharedEncoder = SharedEncoder(UnsafeCell::new(defmt::Encoder::new()));

/// How many records are being written, one inside the other.
static DEPTH: AtomicU32 = AtomicU32::new(0);

fn with_encoder(step: impl FnOnce(&mut defmt::Encoder)) {
    if DEPTH.load(Ordering::Relaxed) == 1 {
        // SAFETY: see `SharedEncoder`.
        step(unsafe { &mut *ENCODER.0.get() });
    }
}

// SAFETY: `acquire` and `release` only count, which is safe from anywhere; see `SharedEncoder` for
// the rest.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        DEPTH.fetch_add(1, Ordering::Relaxed);
        with_encoder(|encoder| encoder.start_frame(rtt::write));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        with_encoder(|encoder| encoder.end_frame(rtt::write));
        DEPTH.fetch_sub(1, Ordering::Relaxed);
    }

    unsafe fn write(bytes: &[u8]) {
        with_encoder(|encoder| encoder.write(bytes, rtt::write));
    }
}
