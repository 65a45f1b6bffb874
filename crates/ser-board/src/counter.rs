//! Counts that one context keeps and another reads, such as an interrupt and the main loop.
//!
//! They use plain loads and stores, also on processors without atomic additions. Each count
//! therefore has a single writer.

use core::sync::atomic::{AtomicU32, Ordering};

/// A count that stops at its largest value. Only one context may count.
#[derive(Debug, Default)]
pub struct Counter(AtomicU32);

impl Counter {
    /// Nothing counted yet.
    #[must_use]
    pub const fn new() -> Counter {
        Counter(AtomicU32::new(0))
    }

    /// Counts one more.
    #[inline]
    pub fn count(&self) {
        self.0.store(self.get().saturating_add(1), Ordering::Relaxed);
    }

    /// The count so far.
    #[inline]
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_stops_at_its_largest_value() {
        let counter = Counter(AtomicU32::new(u32::MAX - 1));
        for _ in 0..3 {
            counter.count();
        }
        assert_eq!(counter.get(), u32::MAX);
        assert_eq!(Counter::new().get(), 0);
    }
}
