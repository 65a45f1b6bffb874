//! The capture interrupt and the clock behind it.
//!
//! # Design
//! Timer 0 interrupts every millisecond. Timer 1 has run freely since reset (see `boot`), and the
//! tick is read from it. The interrupt says *look now*, never *one more millisecond*.
//!
//! # Tradeoffs
//! This takes two timers instead of one. With a tick that counts interrupts, every interrupt that
//! comes later than the next one is due would set the clock back for good.
//!
//! # Notes
//! The timers count down. Timer 1 wraps after 172 s; the interrupt may stay away for that long
//! without a wrong tick. The watchdog acts long before that.

use core::num::NonZeroU32;
use core::sync::atomic::{AtomicU32, Ordering};

use ser_node::{TickCounter, TickStamp};

use crate::device::{self, base};
use crate::mmio::Word;

const COUNTS_PER_MS: NonZeroU32 = NonZeroU32::new(device::CLOCK_HZ / 1000).unwrap();

const ENABLE: u32 = 1 << 0;
const INTERRUPT_ENABLE: u32 = 1 << 3;

struct Registers {
    control: Word,
    value: Word,
    reload: Word,
    interrupt_clear: Word,
}

impl Registers {
    /// # Safety
    /// There is a timer at `base`.
    const unsafe fn at(base: usize) -> Registers {
        // SAFETY: a timer has these four registers, and none of them reaches into memory.
        #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all four")]
        unsafe {
            Registers {
                control: Word::at(base),
                value: Word::at(base + 0x4),
                reload: Word::at(base + 0x8),
                interrupt_clear: Word::at(base + 0xC),
            }
        }
    }

    fn start(&self, reload: u32, control: u32) {
        self.control.write(0);
        self.reload.write(reload);
        self.value.write(reload);
        self.interrupt_clear.write(1);
        self.control.write(control);
    }
}

// SAFETY: AN385 has timers there.
const TIMER0: Registers = unsafe { Registers::at(base::TIMER0) };
// SAFETY: as above.
const TIMER1: Registers = unsafe { Registers::at(base::TIMER1) };

static TICK_MS: AtomicU32 = AtomicU32::new(0);

/// The count at tick 0.
static STARTED_AT: AtomicU32 = AtomicU32::new(0);

/// Milliseconds since boot, wrapping. The tick of the latest sample, for those who have no part in
/// capture.
pub(crate) fn tick_ms() -> u32 {
    TICK_MS.load(Ordering::Relaxed)
}

/// This moment.
pub(crate) fn stamp() -> TickStamp {
    let tick_ms = tick_ms();
    let elapsed = count_up().wrapping_sub(STARTED_AT.load(Ordering::Relaxed));
    TickStamp::new(tick_ms, elapsed, COUNTS_PER_MS)
}

/// Both timers, running.
pub(crate) struct Timer {
    ticks: TickCounter,
}

/// Time since reset, in microseconds; valid for the first 172 s.
pub(crate) fn since_reset_us() -> u32 {
    count_up() / (device::CLOCK_HZ / 1_000_000)
}

impl Timer {
    /// Starts the interrupt; the tick begins at 0.
    pub(crate) fn start() -> Timer {
        TIMER0.start(COUNTS_PER_MS.get() - 1, ENABLE | INTERRUPT_ENABLE);
        let count = count_up();
        STARTED_AT.store(count, Ordering::Relaxed);
        Timer { ticks: TickCounter::new(COUNTS_PER_MS, count) }
    }

    /// Acknowledges the interrupt. Returns the tick, or `None` when the previous interrupt has
    /// already counted this millisecond.
    #[inline]
    pub(crate) fn on_interrupt(&mut self) -> Option<u32> {
        TIMER0.interrupt_clear.write(1);
        let tick_ms = self.ticks.advance(count_up())?;
        TICK_MS.store(tick_ms, Ordering::Relaxed);
        Some(tick_ms)
    }
}

fn count_up() -> u32 {
    !TIMER1.value.read()
}
