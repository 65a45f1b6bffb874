//! A moment between two samples.

use core::num::NonZeroU32;

/// When something arrived: after which sample, and how long after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TickStamp {
    /// The tick of the latest sample, in milliseconds since power-up, wrapping.
    pub tick_ms: u32,
    /// Microseconds since that sample. More than 999 if the next one was late.
    pub us: u16,
}

impl TickStamp {
    /// The moment at which a free-running 32-bit counter has gone on by `elapsed` since tick 0, and
    /// the tick of the latest sample was this.
    ///
    /// Samples are a millisecond apart, so their ticks tell what the counter showed: the capture
    /// interrupt has nothing to do for this. It may be ahead of the counter by a little.
    #[must_use]
    pub fn new(tick_ms: u32, elapsed: u32, counts_per_ms: NonZeroU32) -> TickStamp {
        let since_sample = elapsed.wrapping_sub(tick_ms.wrapping_mul(counts_per_ms.get()));
        let is_ahead = since_sample > u32::MAX / 2;
        let counts = if is_ahead { 0 } else { since_sample };
        let us = u64::from(counts) * 1000 / u64::from(counts_per_ms.get());
        TickStamp { tick_ms, us: u16::try_from(us).unwrap_or(u16::MAX) }
    }
}

/// The moment of a sample.
impl From<u32> for TickStamp {
    fn from(tick_ms: u32) -> TickStamp {
        TickStamp { tick_ms, us: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TickCounter;

    #[test]
    fn microseconds_count_from_the_sample_whatever_has_wrapped() {
        let counts_per_ms = NonZeroU32::new(25_000).unwrap();
        let mut ticks = TickCounter::new(counts_per_ms, 0);
        let mut elapsed = 0_u32;
        // Half an hour: the counter goes round ten times.
        for tick_ms in 1..=1_800_000 {
            elapsed = elapsed.wrapping_add(25_000);
            assert_eq!(ticks.advance(elapsed), Some(tick_ms));
            let at = |later: i32| {
                TickStamp::new(tick_ms, elapsed.wrapping_add_signed(later), counts_per_ms).us
            };
            assert_eq!([at(0), at(24_999), at(25), at(-30), at(75_000)], [0, 999, 1, 0, 3000]);
        }
        assert_eq!(TickStamp::new(5, 4_000_000_000 / 2, counts_per_ms).us, u16::MAX);
    }
}
