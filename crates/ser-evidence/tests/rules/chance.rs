//! Everything that is left to chance. A seed decides all of it.

/// Draws at random.
pub(crate) struct Chance(oorandom::Rand64);

impl Chance {
    pub(crate) fn new(seed: u64) -> Chance {
        Chance(oorandom::Rand64::new(u128::from(seed)))
    }

    /// A number from `low` to `high`, both possible.
    pub(crate) fn between(&mut self, low: i64, high: i64) -> i64 {
        assert!(low <= high, "{low} to {high}");
        let size = u64::try_from(high - low + 1).expect("not the whole of i64");
        low + i64::try_from(self.0.rand_range(0..size)).expect("below the size")
    }

    /// A number from 0 to `size - 1`.
    pub(crate) fn below(&mut self, size: usize) -> usize {
        let size = u64::try_from(size).expect("a size");
        usize::try_from(self.0.rand_range(0..size)).expect("below the size")
    }

    /// True once in `n` times.
    pub(crate) fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// One of these.
    pub(crate) fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// 64 bits, not all of them 0.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0.rand_u64().max(1)
    }

    /// The same in another order.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
