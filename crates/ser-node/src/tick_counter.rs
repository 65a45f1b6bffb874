//! Milliseconds from a free-running hardware counter. Boards make the tick of every sample from
//! them.

use core::num::NonZeroU32;

/// Counts milliseconds by the progress of a free-running 32-bit counter since the last look.
///
/// No time is lost when an interrupt comes late or its predecessors were swallowed: the next look
/// makes up for all of it. It must come at least one millisecond before the counter has gone round
/// once. The first look adds half a millisecond, so that looks which jitter around one per
/// millisecond give exactly one tick each.
#[derive(Clone, Copy, Debug)]
pub struct TickCounter {
    counts_per_ms: NonZeroU32,
    latest_count: u32,
    /// Counts that do not make up a millisecond yet; always less than `counts_per_ms`.
    remainder: u32,
    tick_ms: u32,
}

impl TickCounter {
    /// Starts at tick 0 with the counter at `count`; it counts up and wraps at 2³².
    #[must_use]
    pub const fn new(counts_per_ms: NonZeroU32, count: u32) -> TickCounter {
        let remainder = counts_per_ms.get() / 2;
        TickCounter { counts_per_ms, latest_count: count, remainder, tick_ms: 0 }
    }

    /// Looks at the counter; returns the tick when at least one millisecond has passed.
    #[inline]
    pub fn advance(&mut self, count: u32) -> Option<u32> {
        let elapsed = count.wrapping_sub(self.latest_count);
        self.latest_count = count;
        let counts = self.remainder.wrapping_add(elapsed);
        self.remainder = counts % self.counts_per_ms;
        let elapsed_ms = counts / self.counts_per_ms;
        self.tick_ms = self.tick_ms.wrapping_add(elapsed_ms);
        (elapsed_ms != 0).then_some(self.tick_ms)
    }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "counter and tick wrap")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const COUNTS_PER_MS: NonZeroU32 = NonZeroU32::new(25_000).unwrap();

    #[test]
    fn looks_that_jitter_around_a_millisecond_give_one_tick_each() {
        let start = u32::MAX - 60_000;
        let mut ticks = TickCounter::new(COUNTS_PER_MS, start);
        let looks = [24_000, 51_000, 74_990, 100_010, 125_000];
        let seen = looks.map(|count| ticks.advance(start.wrapping_add(count)));
        assert_eq!(seen, [Some(1), Some(2), Some(3), Some(4), Some(5)]);
    }

    #[test]
    fn a_look_that_comes_too_early_gives_no_tick_and_loses_no_time() {
        let mut ticks = TickCounter::new(COUNTS_PER_MS, 0);
        assert_eq!(ticks.advance(12_499), None);
        assert_eq!(ticks.advance(12_500), Some(1));
        assert_eq!(ticks.advance(37_499), None);
        assert_eq!(ticks.advance(37_500), Some(2));
    }

    #[test]
    fn a_late_look_makes_up_for_everything() {
        let mut ticks = TickCounter::new(COUNTS_PER_MS, 7);
        assert_eq!(ticks.advance(7 + 25_000 * 1000), Some(1000));
        assert_eq!(ticks.advance(7 + 25_000 * 1001), Some(1001));
    }

    proptest! {
        #[test]
        fn ticks_follow_the_counter_whatever_the_looks_are(
            counts_per_ms in prop_oneof![1..100_000_u32, 1..u32::MAX],
            start: u32,
            steps in prop::collection::vec(prop_oneof![0..100_000_u32, any::<u32>()], 0..50),
        ) {
            // One turn of the counter minus a millisecond.
            let steps = steps.into_iter().map(|step| step.min(u32::MAX - counts_per_ms));
            let mut ticks = TickCounter::new(NonZeroU32::new(counts_per_ms).unwrap(), start);
            let (mut passed, mut latest) = (0_u64, 0);
            for step in steps {
                passed += u64::from(step);
                let tick_ms = ticks.advance(start.wrapping_add(passed as u32));
                let expected = ((passed + u64::from(counts_per_ms / 2)) / u64::from(counts_per_ms)) as u32;
                prop_assert_eq!(tick_ms, (expected != latest).then_some(expected));
                latest = expected;
            }
        }
    }
}
