//! Puts accepted changes in the order in which they began.
//!
//! A debounced change is accepted late but stamped with its first moment. Inputs with different
//! debounce times are therefore accepted in a different order from the one in which they changed.
//! The sequencer holds changes back for the longest debounce time, because an earlier one can turn
//! up until then, and hands them on in order. Without debounce it holds nothing back.
//!
//! The sequencer also holds back changes that came after a datagram that waits, unread, in the GENI
//! board. That datagram may set the clock and mode by which they are recorded.

use ser_proto::Inputs;

use crate::debounce::Debounce;

/// Changes of that many different milliseconds can wait.
const WINDOW_MS: u32 = 320;

/// The same, as a number of places.
pub(crate) const WINDOW: usize = WINDOW_MS as usize;

/// The longest time that a change is held back, in milliseconds: for debounce, and for a datagram
/// that arrived before it. The longest debounce time of 255 ms leaves 64 ms for the datagram.
pub const HELD_BACK_MS: u64 = WINDOW_MS as u64 - 1;

/// Inputs that changed in the same millisecond, by their first moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Change {
    /// When, in milliseconds since power-up.
    pub tick_ms: u64,
    /// The inputs that changed.
    pub changed: u32,
    /// The inputs that are on after it.
    pub state: u32,
}

/// Inputs that changed in one millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    changed: u32,
    /// Inputs whose change capture had to drop. Their new state is in effect from here on, but in
    /// no change.
    dropped: u32,
}

impl Place {
    pub(crate) const EMPTY: Place = Place { changed: 0, dropped: 0 };
}

/// Changes on their way from capture to log.
pub(crate) struct Sequencer<'a> {
    debounce: Debounce,
    hold_ms: u64,
    /// Changes by the low bits of the tick at which they began.
    waiting: &'a mut [Place; WINDOW],
    /// Number of places that are not empty.
    waiting_count: usize,
    /// Changes after this tick wait.
    hold_after_ms: Option<u64>,
    /// No change that began before this tick is waiting or will come.
    front_ms: u64,
    /// When the latest change that was handed on began.
    handed_on_ms: u64,
    /// The state after the changes that were accepted, and after those that were handed on.
    accepted: u32,
    state: u32,
}

impl<'a> Sequencer<'a> {
    pub(crate) fn new(debounce: Debounce, waiting: &'a mut [Place; WINDOW]) -> Sequencer<'a> {
        *waiting = [Place::EMPTY; WINDOW];
        Sequencer {
            debounce,
            hold_ms: debounce.longest_ms().into(),
            waiting,
            waiting_count: 0,
            hold_after_ms: None,
            front_ms: 0,
            handed_on_ms: 0,
            accepted: 0,
            state: 0,
        }
    }

    /// Takes the baseline: the state of the inputs before any change.
    pub(crate) fn baseline(&mut self, state: u32) {
        self.accepted = state;
        self.state = state;
    }

    /// Changes that are accepted from now on went through these debounce times. No input whose
    /// time changes was being debounced then, so what it does next begins later.
    pub(crate) fn change_debounce(&mut self, debounce: Debounce) {
        self.debounce = debounce;
        self.hold_ms = debounce.longest_ms().into();
    }

    /// Holds back changes after this tick, for as long as there is room.
    pub(crate) fn hold_after(&mut self, tick_ms: Option<u64>) {
        self.hold_after_ms = tick_ms;
    }

    /// All changes that began up to this tick have been handed on.
    pub(crate) fn settled_ms(&self) -> u64 {
        self.front_ms.saturating_sub(1)
    }

    /// Whether a change that began after this tick has been handed on.
    pub(crate) fn is_past(&self, tick_ms: u64) -> bool {
        self.handed_on_ms > tick_ms
    }

    /// Takes a change that was accepted at `tick_ms`. Every earlier one must have been taken out
    /// with [`next`](Self::next).
    pub(crate) fn push(&mut self, tick_ms: u64, changed: u32, state: u32) {
        // Changes that capture had to drop are in no sample, but they show in the states.
        let dropped = state ^ changed ^ self.accepted;
        self.accepted = state;
        self.put(tick_ms, changed, |place, bit| place.changed |= bit);
        // The dropped changes were accepted before this sample and began no later than a change of
        // this sample would have. Waiting changes from before that time must not show them.
        self.put(tick_ms, dropped, |place, bit| place.dropped |= bit);
    }

    /// Enters inputs that were accepted at `tick_ms` in the millisecond in which they changed.
    fn put(&mut self, tick_ms: u64, inputs: u32, put: impl Fn(&mut Place, u32)) {
        for number in Inputs(inputs).numbers() {
            let began_ms = tick_ms.saturating_sub(self.debounce.time_ms(number).into());
            if let Some(place) = self.waiting.get_mut(slot(began_ms)) {
                self.waiting_count += usize::from(*place == Place::EMPTY);
                put(place, 1 << (number - 1));
            }
        }
    }

    /// The next change in order, once all samples before `before_ms` have been pushed.
    pub(crate) fn next(&mut self, before_ms: u64) -> Option<Change> {
        let in_order_ms = before_ms.saturating_sub(self.hold_ms);
        let end_ms = match self.hold_after_ms {
            Some(tick_ms) => {
                in_order_ms.min((tick_ms + 1).max(before_ms.saturating_sub(HELD_BACK_MS)))
            }
            None => in_order_ms,
        };
        while self.waiting_count > 0 && self.front_ms < end_ms {
            let tick_ms = self.front_ms;
            self.front_ms += 1;
            let place = self.waiting.get_mut(slot(tick_ms))?;
            let Place { changed, dropped } = core::mem::replace(place, Place::EMPTY);
            self.waiting_count -= usize::from(changed | dropped != 0);
            self.state ^= dropped;
            if changed != 0 {
                self.handed_on_ms = tick_ms;
                self.state ^= changed;
                return Some(Change { tick_ms, changed, state: self.state });
            }
        }
        if self.waiting_count == 0 {
            self.front_ms = self.front_ms.max(end_ms);
        }
        None
    }
}

/// The place of a millisecond among the latest [`WINDOW`] of them.
///
/// Calculates in steps of 32 bits: a Cortex-M divides 32 bits with one instruction and 64 bits with
/// hundreds.
pub(crate) fn slot(tick_ms: u64) -> usize {
    /// 2^32 modulo the window.
    const WRAP: u32 = 0_u32.wrapping_sub(WINDOW_MS) % WINDOW_MS;
    const { assert!(WINDOW_MS <= 1 << 16, "the product fits") };
    let [a, b, c, d, e, f, g, h] = tick_ms.to_le_bytes();
    let (low, high) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    ((high % WINDOW_MS * WRAP + low % WINDOW_MS) % WINDOW_MS) as usize
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::CaptureChannel;
    use crate::ticks::Ticks;

    /// Runs samples through capture and sequencer; the main loop looks only at every `every`-th
    /// sample.
    fn sequence(debounce: Debounce, samples: &[u32], every: usize) -> Vec<Change> {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(debounce);
        let mut places = [Place::EMPTY; WINDOW];
        let (mut sequencer, mut ticks, mut changes) =
            (Sequencer::new(debounce, &mut places), Ticks::new(), Vec::new());
        let settling = std::iter::repeat_n(*samples.last().unwrap_or(&0), 2 * 256);
        for (tick_ms, inputs) in (1_u32..).zip(samples.iter().copied().chain(settling)) {
            capture.sample(tick_ms, inputs);
            if !(tick_ms as usize).is_multiple_of(every) {
                continue;
            }
            while let Some(sample) = reader.next_if(|_| true) {
                let tick_ms = ticks.extend(sample.tick_ms);
                changes.extend(std::iter::from_fn(|| sequencer.next(tick_ms)));
                match sample.changed {
                    0 => sequencer.baseline(sample.state),
                    changed => sequencer.push(tick_ms, changed, sample.state),
                }
            }
            changes.extend(std::iter::from_fn(|| sequencer.next(u64::from(tick_ms) + 1)));
        }
        changes
    }

    /// The expected result: the first moments of lasting changes, for each input alone, sorted by
    /// time. `time_ms` is the debounce time of an input for what it does from a sample on.
    pub(crate) fn expected(time_ms: impl Fn(usize, u8) -> u8, samples: &[u32]) -> Vec<(u64, u32)> {
        let mut toggles = std::collections::BTreeMap::<u64, u32>::new();
        for bit in 0..32_u8 {
            let on = |index: usize| samples.get(index).or(samples.last()).unwrap() >> bit & 1;
            let mut accepted = on(0);
            for index in 0..samples.len() {
                let lasts = usize::from(time_ms(index, bit + 1));
                if on(index) != accepted
                    && (index..=index + lasts).all(|later| on(later) != accepted)
                {
                    accepted ^= 1;
                    *toggles.entry(index as u64 + 1).or_default() |= 1 << bit;
                }
            }
        }
        toggles.into_iter().collect()
    }

    proptest! {
        #[test]
        fn changes_come_out_in_the_order_in_which_they_began(
            times in prop::collection::vec((1..=32_u8, any::<u8>()), 0..8),
            runs in prop::collection::vec((any::<u32>(), 1..40_usize), 1..40),
            every in 1..8_usize,
        ) {
            let debounce = times.iter().fold(Debounce::OFF, |all, &(number, time)| all.with(number, time));
            let samples: Vec<u32> =
                runs.iter().flat_map(|&(inputs, times)| std::iter::repeat_n(inputs, times)).collect();
            let changes = sequence(debounce, &samples, every);
            let seen: Vec<_> = changes.iter().map(|change| (change.tick_ms, change.changed)).collect();
            let time_ms = |_, number| debounce.time_ms(number);
            prop_assert_eq!(seen, expected(time_ms, &samples));
            let mut state = samples[0];
            for change in changes {
                state ^= change.changed;
                prop_assert_eq!(change.state, state);
            }
        }
    }

    #[test]
    fn slots_are_those_of_a_division() {
        for tick_ms in
            [0, 1, 319, 320, 321, (1 << 32) - 1, 1 << 32, (1 << 32) + 1, u64::MAX - 1, u64::MAX]
        {
            assert_eq!(slot(tick_ms) as u64, tick_ms % WINDOW as u64, "{tick_ms}");
        }
    }

    #[test]
    fn a_debounced_contact_that_moved_first_comes_first() {
        // Input 1 moves at tick 2 and has 5 ms of debounce; input 2 moves at tick 4 and has none.
        let changes = sequence(Debounce::OFF.with(1, 5), &[0, 1, 1, 3], 1);
        let seen: Vec<_> = changes.iter().map(|c| (c.tick_ms, c.changed, c.state)).collect();
        assert_eq!(seen, [(2, 1, 1), (4, 2, 3)]);
    }

    #[test]
    fn changes_after_a_datagram_wait_for_it_and_no_longer_than_there_is_room() {
        let mut places = [Place::EMPTY; WINDOW];
        let mut sequencer = Sequencer::new(Debounce::OFF, &mut places);
        sequencer.baseline(0);
        sequencer.hold_after(Some(10));
        for tick_ms in [9, 10, 11, 12] {
            sequencer.push(tick_ms, 1, u32::from(tick_ms % 2 == 0));
        }
        let ticks = |sequencer: &mut Sequencer<'_>, before_ms| -> Vec<u64> {
            std::iter::from_fn(|| sequencer.next(before_ms)).map(|change| change.tick_ms).collect()
        };
        assert_eq!(ticks(&mut sequencer, 13), [9, 10]);
        assert_eq!(ticks(&mut sequencer, 11 + HELD_BACK_MS), []);
        assert!(!sequencer.is_past(10));
        assert_eq!(ticks(&mut sequencer, 12 + HELD_BACK_MS), [11]);
        assert!(sequencer.is_past(10) && !sequencer.is_past(11));
        sequencer.hold_after(None);
        assert_eq!(ticks(&mut sequencer, 12 + HELD_BACK_MS), [12]);
    }

    #[test]
    fn with_the_longest_debounce_and_the_longest_hold_every_change_finds_its_place() {
        let mut places = [Place::EMPTY; WINDOW];
        let mut sequencer = Sequencer::new(Debounce::uniform(255).with(1, 0), &mut places);
        sequencer.hold_after(Some(0));
        let mut seen = Vec::new();
        for tick_ms in 1..=2_000_u64 {
            seen.extend(
                std::iter::from_fn(|| sequencer.next(tick_ms)).map(|change| change.tick_ms),
            );
            sequencer.push(tick_ms, 1, u32::from(tick_ms % 2 == 1));
        }
        let expected: Vec<u64> = (1..2_000 - HELD_BACK_MS).collect();
        assert_eq!(seen, expected);
    }

    #[test]
    fn changes_that_capture_dropped_do_not_falsify_the_state() {
        let mut places = [Place::EMPTY; WINDOW];
        let mut sequencer = Sequencer::new(Debounce::OFF, &mut places);
        sequencer.baseline(0);
        // Input 3 came on in a sample that was dropped: the next one shows it as on without a
        // change.
        sequencer.push(10, 0b0001, 0b0101);
        assert_eq!(
            sequencer.next(11),
            Some(Change { tick_ms: 10, changed: 0b0001, state: 0b0101 })
        );
        sequencer.push(12, 0b0100, 0b0001);
        assert_eq!(
            sequencer.next(13),
            Some(Change { tick_ms: 12, changed: 0b0100, state: 0b0001 })
        );
    }

    #[test]
    fn changes_that_wait_do_not_show_what_was_dropped_after_them() {
        let change = |tick_ms, changed, state| Some(Change { tick_ms, changed, state });
        let mut places = [Place::EMPTY; WINDOW];
        let mut sequencer = Sequencer::new(Debounce::OFF, &mut places);
        sequencer.baseline(0);
        sequencer.hold_after(Some(8));
        sequencer.push(9, 0b0001, 0b0001);
        sequencer.push(10, 0b0010, 0b0011);
        // Input 3 came on in between, in a sample that found no room.
        sequencer.push(20, 0b0001, 0b0110);
        assert_eq!(sequencer.next(21), None);
        sequencer.hold_after(None);
        assert_eq!(sequencer.next(21), change(9, 0b0001, 0b0001));
        assert_eq!(sequencer.next(21), change(10, 0b0010, 0b0011));
        assert_eq!(sequencer.next(21), change(20, 0b0001, 0b0110));
        assert_eq!(sequencer.next(21), None);
    }

    #[test]
    fn what_was_dropped_with_debounce_is_in_effect_when_it_can_have_begun_at_the_latest() {
        let change = |tick_ms, changed, state| Some(Change { tick_ms, changed, state });
        let mut places = [Place::EMPTY; WINDOW];
        let mut sequencer = Sequencer::new(Debounce::OFF.with(2, 10).with(3, 5), &mut places);
        sequencer.baseline(0);
        sequencer.push(100, 0b0010, 0b0010);
        sequencer.push(101, 0b0001, 0b0011);
        // Input 3 is on. Nobody has seen when it came on, but it was before 105.
        sequencer.push(110, 0b0011, 0b0100);
        let seen: Vec<_> = std::iter::from_fn(|| sequencer.next(121)).map(Some).collect();
        let expected = [
            change(90, 0b0010, 0b0010),
            change(100, 0b0010, 0b0000),
            change(101, 0b0001, 0b0001),
            change(110, 0b0001, 0b0100),
        ];
        assert_eq!(seen, expected);
        assert_eq!(sequencer.waiting_count, 0);
    }
}
