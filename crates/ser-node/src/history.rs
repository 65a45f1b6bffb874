//! A value and its recent past.
//!
//! A change is recorded up to [`HELD_BACK_MS`](crate::HELD_BACK_MS) after it happened, by the value
//! that was in force when it happened. A history therefore has a place for every millisecond of
//! that span. Settings may come over both ports, in any number, and may be read in any order: no
//! setting that still decides about a change is forgotten.

use crate::sequencer::{WINDOW, slot};

/// Milliseconds that are remembered. The oldest change still to be recorded is younger than this.
pub(crate) const SPAN: usize = WINDOW;

/// Bits of a word.
const BITS: usize = u32::BITS as usize;

/// What holds a value for each millisecond of the span.
pub(crate) trait Places<T> {
    fn get(&self, place: usize) -> Option<T>;
    fn put(&mut self, place: usize, value: T);
}

impl<T: Copy> Places<T> for [T; SPAN] {
    fn get(&self, place: usize) -> Option<T> {
        <[T]>::get(self, place).copied()
    }

    fn put(&mut self, place: usize, value: T) {
        if let Some(at) = self.get_mut(place) {
            *at = value;
        }
    }
}

impl<T: Copy> Places<T> for &mut [T; SPAN] {
    fn get(&self, place: usize) -> Option<T> {
        <[T]>::get(*self, place).copied()
    }

    fn put(&mut self, place: usize, value: T) {
        (**self).put(place, value);
    }
}

/// One bit each.
#[derive(Clone, Debug)]
pub(crate) struct Bits([u32; SPAN / BITS]);

impl Bits {
    const NONE: Bits = Bits([0; SPAN / BITS]);

    fn word(&self, place: usize) -> Option<u32> {
        self.0.get(place / BITS).copied()
    }
}

impl Places<bool> for Bits {
    fn get(&self, place: usize) -> Option<bool> {
        Some(self.word(place)? >> (place % BITS) & 1 == 1)
    }

    fn put(&mut self, place: usize, value: bool) {
        if let Some(word) = self.0.get_mut(place / BITS) {
            *word = *word & !(1 << (place % BITS)) | u32::from(value) << (place % BITS);
        }
    }
}

/// A value over time.
#[derive(Clone, Debug)]
pub(crate) struct History<T, P = [T; SPAN]> {
    /// The value before the first millisecond that has a place, and when it was set.
    before: (u64, T),
    /// The latest setting of all. Its millisecond is the latest that has a place.
    latest: (u64, T),
    /// The last value set in each millisecond. The bits below say which milliseconds have one.
    values: P,
    is_set: Bits,
}

impl<T: Copy, P: Places<T>> History<T, P> {
    /// With these places, whatever they hold.
    pub(crate) const fn with_places(values: P, value: T) -> History<T, P> {
        History { before: (0, value), latest: (0, value), values, is_set: Bits::NONE }
    }
}

#[cfg(test)]
impl<T: Copy> History<T> {
    fn new(value: T) -> History<T> {
        History::with_places([value; SPAN], value)
    }
}

impl History<bool, Bits> {
    /// Of something that is or is not: in a bit for each millisecond.
    pub(crate) const fn of_bits(value: bool) -> Self {
        History { before: (0, value), latest: (0, value), values: Bits::NONE, is_set: Bits::NONE }
    }
}

impl<T: Copy, P: Places<T>> History<T, P> {
    /// Sets the value in millisecond `tick_ms`. The sample of that millisecond has been taken
    /// already.
    pub(crate) fn set(&mut self, tick_ms: u64, value: T) {
        if tick_ms + SPAN as u64 <= self.latest.0 {
            // All changes of that time have been recorded. This setting may still be the latest one
            // before the milliseconds that have a place.
            if tick_ms >= self.before.0 {
                self.before = (tick_ms, value);
            }
            return;
        }
        if tick_ms >= self.latest.0 {
            self.go_on_to(tick_ms);
            self.latest = (tick_ms, value);
        }
        let place = slot(tick_ms);
        self.values.put(place, value);
        self.is_set.put(place, true);
    }

    /// Reuses the places of milliseconds that are too long ago for those up to `tick_ms`.
    fn go_on_to(&mut self, tick_ms: u64) {
        let begin_ms = tick_ms.saturating_sub(SPAN as u64 - 1);
        self.before = self.setting_before(begin_ms);
        if begin_ms > self.latest.0 {
            self.is_set = Bits::NONE;
            return;
        }
        for ms in self.latest.0 + 1..=tick_ms {
            self.is_set.put(slot(ms), false);
        }
    }

    /// The value now.
    pub(crate) fn latest(&self) -> T {
        self.latest.1
    }

    /// The value when the sample of millisecond `tick_ms` was taken.
    pub(crate) fn at_sample(&self, tick_ms: u64) -> T {
        self.setting_before(tick_ms).1
    }

    /// The latest setting before this millisecond, and its time.
    fn setting_before(&self, tick_ms: u64) -> (u64, T) {
        // The usual case: clocks are seldom set.
        if tick_ms > self.latest.0 {
            return self.latest;
        }
        self.find_before(tick_ms).unwrap_or(self.before)
    }

    /// The same, among the settings that have a place.
    fn find_before(&self, tick_ms: u64) -> Option<(u64, T)> {
        let mut ms = tick_ms.checked_sub(1)?;
        while ms + SPAN as u64 > self.latest.0 {
            let place = slot(ms);
            let word = self.is_set.word(place)? << (BITS - 1 - place % BITS);
            if word != 0 {
                let at_ms = ms.checked_sub(word.leading_zeros().into())?;
                // Further back, the places already belong to the latest milliseconds.
                let has_place = at_ms + SPAN as u64 > self.latest.0;
                return self
                    .values
                    .get(slot(at_ms))
                    .filter(|_| has_place)
                    .map(|value| (at_ms, value));
            }
            ms = ms.checked_sub(place as u64 % BITS as u64 + 1)?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SPAN_MS: u64 = SPAN as u64;

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
    fn of_two_settings_in_a_millisecond_the_last_counts() {
        let mut history = History::new('a');
        history.set(10, 'b');
        history.set(10, 'c');
        assert_eq!((history.at_sample(10), history.at_sample(11)), ('a', 'c'));
    }

    #[test]
    fn a_setting_that_is_read_late_has_its_place_before_those_that_came_after_it() {
        let mut history = History::new('a');
        history.set(20, 'c');
        history.set(10, 'b');
        let seen: String = [10, 11, 20, 21].map(|tick| history.at_sample(tick)).iter().collect();
        assert_eq!(seen, "abbc");
        assert_eq!(history.latest(), 'c');
        // The setting counts although it has no place any more.
        history.set(5_000, 'e');
        history.set(30, 'd');
        history.set(15, 'x');
        assert_eq!((history.at_sample(5_000), history.latest()), ('d', 'e'));
    }

    #[test]
    fn a_setting_in_every_millisecond_is_remembered_for_the_whole_span() {
        let mut history = History::new(0);
        for tick_ms in 1..=2_000_u64 {
            history.set(tick_ms, tick_ms);
        }
        for tick_ms in 2_000 - SPAN_MS + 2..=2_001 {
            assert_eq!(history.at_sample(tick_ms), tick_ms - 1);
        }
        // The setting that was forgotten last stands before the first remembered one.
        assert_eq!(history.at_sample(2), 2_000 - SPAN_MS);
    }

    proptest! {
        /// Compares with a list that forgets nothing, for every question that can still be asked.
        #[test]
        fn it_is_a_list_of_settings(
            start_ms in prop_oneof![Just(0_u64), Just(u64::from(u32::MAX) - 300)],
            settings in prop::collection::vec((0..600_u64, 0..500_u64), 0..60),
        ) {
            let (mut now_ms, mut history, mut list) = (start_ms, History::new(0), vec![(0, 0)]);
            let mut bits = History::of_bits(false);
            for (number, (after_ms, ago_ms)) in (1..).zip(settings) {
                now_ms += after_ms;
                let tick_ms = now_ms.saturating_sub(ago_ms);
                history.set(tick_ms, number);
                bits.set(tick_ms, number % 3 == 1);
                let behind = list.partition_point(|&(at_ms, _)| at_ms <= tick_ms);
                list.insert(behind, (tick_ms, number));
                let latest_ms = list.last().expect("the first").0;
                for tick_ms in (latest_ms + 2).saturating_sub(SPAN_MS)..=latest_ms + 1 {
                    let behind = list.partition_point(|&(at_ms, _)| at_ms < tick_ms).max(1);
                    let expected = list[behind - 1].1;
                    prop_assert_eq!(history.at_sample(tick_ms), expected, "{} {:?}", tick_ms, &list);
                    prop_assert_eq!(bits.at_sample(tick_ms), expected % 3 == 1, "{} {:?}", tick_ms, &list);
                }
                prop_assert_eq!(history.latest(), list.last().expect("the first").1);
            }
        }
    }
}
