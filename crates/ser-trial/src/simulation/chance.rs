//! Everything that is left to chance, from one seed: the same seed, the same run.

use std::ops::RangeInclusive;

use oorandom::Rand64;

/// A source of decisions.
#[derive(Clone, Debug)]
pub struct Chance(Rand64);

impl Chance {
    /// The decisions of this seed.
    #[must_use]
    pub fn new(seed: u64) -> Chance {
        Chance(Rand64::new(seed.into()))
    }

    /// Decisions of its own for one part of the run, so that it stays the same when another part
    /// asks more often.
    #[must_use]
    pub fn branch(&mut self) -> Chance {
        Chance::new(self.0.rand_u64())
    }

    /// A number below `end`, which is not 0.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0.rand_range(0..end)
    }

    /// A number in a range.
    pub fn within(&mut self, range: RangeInclusive<u64>) -> u64 {
        range.start() + self.below(range.end() - range.start() + 1)
    }

    /// A number in a range, small ones as often as large ones: as many from 1 to 10 as from 100 to
    /// 1000.
    pub fn spread(&mut self, range: RangeInclusive<u64>) -> u64 {
        let (low, high) = (*range.start(), *range.end());
        let doublings = (high / low.max(1)).max(1).ilog2();
        let base = low << self.below(u64::from(doublings) + 1);
        self.within(base..=(base * 2).clamp(base, high.max(base)))
    }

    /// True once in `times` on the average.
    pub fn one_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    /// One of these, which are not none.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        let index = self.below(from.len() as u64);
        from[usize::try_from(index).unwrap_or(0)]
    }

    /// A number of 8 bits.
    #[expect(clippy::cast_possible_truncation, reason = "eight of the bits are wanted")]
    pub fn byte(&mut self) -> u8 {
        self.0.rand_u64() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_means_the_same_run_with_every_version() {
        let mut chance = Chance::new(1_234_567);
        let drawn =
            [chance.below(1 << 32), chance.branch().below(1 << 32), chance.spread(1..=1_000_000)];
        assert_eq!(drawn, [1_721_271_454, 2_249_846_495, 10_311]);
    }
}
