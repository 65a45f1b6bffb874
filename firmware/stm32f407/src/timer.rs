//! The capture interrupt and the clock behind it.
//!
//! # Design
//! Timer 3 interrupts every millisecond. Timer 2 is a free-running count of microseconds, and the
//! tick is read from it. The interrupt says *look now*, never *one more millisecond*. Both have the
//! same clock, so they do not drift apart.
//!
//! # Notes
//! Timer 2 wraps after 71 minutes; the interrupt may stay away for that long without a wrong tick.
//! The watchdog acts long before that.

use core::num::NonZeroU32;
use core::sync::atomic::{AtomicU32, Ordering};

use ser_node::{TickCounter, TickStamp};
use stm32f4::stm32f407::{RCC, TIM2, TIM3};

use crate::clocks;

const COUNTS_PER_SECOND: u32 = 1_000_000;
const COUNTS_PER_MS: NonZeroU32 = NonZeroU32::new(COUNTS_PER_SECOND / 1000).unwrap();

const PRESCALER: u16 = (clocks::TIMER_HZ / COUNTS_PER_SECOND) as u16;
const _: () = assert!(PRESCALER as u32 * COUNTS_PER_SECOND == clocks::TIMER_HZ);

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
    let elapsed = count_us().wrapping_sub(STARTED_AT.load(Ordering::Relaxed));
    TickStamp::new(tick_ms, elapsed, COUNTS_PER_MS)
}

/// Both timers, running.
pub(crate) struct Timer {
    interval: TIM3,
    counter: TIM2,
    ticks: TickCounter,
}

impl Timer {
    /// Starts both timers.
    pub(crate) fn start(rcc: &RCC, counter: TIM2, interval: TIM3) -> Timer {
        rcc.apb1enr().modify(|_, w| w.tim2en().set_bit().tim3en().set_bit());
        clocks::settle();
        // The update event loads the prescaler. Its flag must not count as an interrupt.
        counter.psc().write(|w| w.psc().set(PRESCALER - 1));
        counter.arr().write(|w| w.arr().set(u32::MAX));
        counter.egr().write(|w| w.ug().set_bit());
        counter.cr1().write(|w| w.cen().set_bit());

        interval.psc().write(|w| w.psc().set(PRESCALER - 1));
        #[expect(clippy::cast_possible_truncation, reason = "999")]
        interval.arr().write(|w| w.arr().set((COUNTS_PER_MS.get() - 1) as u16));
        interval.egr().write(|w| w.ug().set_bit());
        interval.sr().write(|w| w.uif().clear_bit());
        interval.dier().write(|w| w.uie().set_bit());
        interval.cr1().write(|w| w.cen().set_bit());

        let count_us = counter.cnt().read().bits();
        STARTED_AT.store(count_us, Ordering::Relaxed);
        let ticks = TickCounter::new(COUNTS_PER_MS, count_us);
        Timer { interval, counter, ticks }
    }

    /// Acknowledges the interrupt. Returns the tick, or `None` when the previous interrupt has
    /// already counted this millisecond.
    #[inline]
    pub(crate) fn on_interrupt(&mut self) -> Option<u32> {
        self.interval.sr().write(|w| w.uif().clear_bit());
        let tick_ms = self.ticks.advance(self.counter.cnt().read().bits())?;
        TICK_MS.store(tick_ms, Ordering::Relaxed);
        Some(tick_ms)
    }
}

fn count_us() -> u32 {
    // SAFETY: the register is there, and a look at the count changes nothing.
    unsafe { (*TIM2::ptr()).cnt().read().bits() }
}
