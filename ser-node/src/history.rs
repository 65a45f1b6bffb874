//! A value, and what it was a short while ago.
//!
//! Debounce brings changes up to 255 ms after they happened, and what was in force then decides about them. A history
//! therefore remembers the settings of the last 256 ms.

use heapless::Deque;

/// How long ago a change can have happened that is recorded only now.
const SPAN_MS: u64 = 256;

/// Settings that can be remembered. A command of nine characters takes 4.7 ms at 19,200 bit/s, so no line brings
/// more than 55 of them in the span.
const LEN: usize = 64;

/// A value over time.
#[derive(Clone, Debug)]
pub(crate) struct History<T> {
    /// The value before the first of the settings.
    before: T,
    /// When it was set to what, in the order of ticks.
    settings: Deque<(u64, T), LEN>,
}

impl<T: Copy> History<T> {
    pub(crate) const fn new(value: T) -> History<T> {
        History { before: value, settings: Deque::new() }
    }

    /// Sets the value in millisecond `tick_ms`. The sample of that millisecond has been taken already.
    pub(crate) fn set(&mut self, tick_ms: u64, value: T) {
        while self.settings.is_full() || self.settings.front().is_some_and(|(at, _)| at + SPAN_MS < tick_ms) {
            let Some((_, value)) = self.settings.pop_front() else { break };
            self.before = value;
        }
        // There is room: the loop has seen to it.
        let _ = self.settings.push_back((tick_ms, value));
    }

    /// The value now.
    pub(crate) fn latest(&self) -> T {
        self.settings.back().map_or(self.before, |&(_, value)| value)
    }

    /// The value when the sample of millisecond `tick_ms` was taken.
    pub(crate) fn at_sample(&self, tick_ms: u64) -> T {
        let in_force = self.settings.iter().rev().find(|(at, _)| *at < tick_ms);
        in_force.map_or(self.before, |&(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_finds_what_was_in_force_when_it_was_taken() {
        let mut history = History::new('a');
        history.set(10, 'b');
        history.set(13, 'c');
        let seen: String = [9, 10, 11, 13, 14].map(|tick| history.at_sample(tick)).iter().collect();
        assert_eq!(seen, "aabbc");
        assert_eq!(history.latest(), 'c');
    }

    #[test]
    fn what_is_too_long_ago_is_forgotten() {
        let mut history = History::new(0);
        for tick_ms in 1..=1000_u64 {
            history.set(tick_ms, tick_ms);
        }
        assert_eq!(history.latest(), 1000);
        assert_eq!(history.at_sample(1000), 999);
        // 64 settings are remembered; before the oldest of them stands the one that was forgotten last.
        assert_eq!(history.at_sample(937), 936);
        assert_eq!(history.at_sample(2), 936);
    }
}
