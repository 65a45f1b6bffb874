//! The chatter filter: a contact that moves too often is left out of the log until it is quiet.
//!
//! It stands behind the sequencer, in the main loop, and sees changes in the order in which they
//! began. Every change up to the one by which chatter is recognised is recorded as it is. From there
//! on the log shows the input as it was last recorded, and its changes are counted. When it has been
//! quiet for its re-arm time, an entry of that moment shows where it came to rest, if that differs.

use ser_proto::{ChatterFilter, Inputs};

use crate::sequencer::Change;

/// The filter at work, for all inputs.
pub(crate) struct Chatter<'a> {
    inputs: &'a mut [Input; 32],
    /// Inputs whose filter is on.
    on: u32,
    /// Inputs that chatter.
    chattering: u32,
    /// The inputs that are on: as they are, and as the log shows them.
    state: u32,
    recorded: u32,
    /// All changes up to this tick are known.
    settled_ms: u64,
}

/// What is known of one input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input {
    filter: Option<ChatterFilter>,
    /// When its window began, and how many changes there were since.
    window_began_ms: u64,
    changes: u8,
    /// When it changed last.
    changed_ms: u64,
    /// How many of its changes were left out since power-up.
    suppressed: u32,
}

impl Input {
    pub(crate) const NEW: Input =
        Input { filter: None, window_began_ms: 0, changes: 0, changed_ms: 0, suppressed: 0 };

    /// Takes a change. Whether it is the one by which chatter is recognised.
    fn count(&mut self, tick_ms: u64) -> bool {
        let Some(filter) = self.filter else { return false };
        let is_over = tick_ms.saturating_sub(self.window_began_ms) >= filter.window_ms.into();
        if is_over || self.changes == 0 {
            self.window_began_ms = tick_ms;
            self.changes = 0;
        }
        self.changes = self.changes.saturating_add(1);
        self.changed_ms = tick_ms;
        self.changes >= filter.changes.get()
    }

    /// Takes a change that is left out.
    fn suppress(&mut self, tick_ms: u64) {
        self.changed_ms = tick_ms;
        self.suppressed = self.suppressed.saturating_add(1);
    }
}

impl<'a> Chatter<'a> {
    pub(crate) fn new(inputs: &'a mut [Input; 32]) -> Chatter<'a> {
        *inputs = [Input::NEW; 32];
        Chatter { inputs, on: 0, chattering: 0, state: 0, recorded: 0, settled_ms: 0 }
    }

    /// Takes the state of the inputs before any change.
    pub(crate) fn baseline(&mut self, state: u32) {
        (self.state, self.recorded) = (state, state);
    }

    /// From now on this filter holds for input `number` (1–32). An input that chatters does so until
    /// it has been quiet for the new re-arm time; without a filter it ends at once.
    pub(crate) fn set_filter(&mut self, number: u8, filter: Option<ChatterFilter>) {
        let index = usize::from(number).wrapping_sub(1);
        let Some(input) = self.inputs.get_mut(index) else { return };
        if input.filter != filter {
            input.filter = filter;
            input.changes = 0;
        }
        self.on = self.on & !(1 << index) | u32::from(filter.is_some()) << index;
    }

    /// The inputs that chatter now.
    pub(crate) const fn chattering(&self) -> Inputs {
        Inputs(self.chattering)
    }

    /// How many changes of input `number` (1–32) were left out since power-up. Stops at the largest
    /// value.
    pub(crate) fn suppressed(&self, number: u8) -> u32 {
        let index = usize::from(number).wrapping_sub(1);
        self.inputs.get(index).map_or(0, |input| input.suppressed)
    }

    /// Takes the next change, and hands on what of it is recorded.
    pub(crate) fn take(&mut self, change: Change, mut record: impl FnMut(Change)) {
        let Change { tick_ms, state, .. } = change;
        if self.on | self.chattering == 0 {
            (self.state, self.recorded) = (state, state);
            record(change);
            return;
        }
        self.settle(tick_ms.saturating_sub(1), &mut record);
        self.state = state;
        // An input that chattered until its filter was switched off is as it is.
        let off = self.chattering & !self.on;
        self.chattering &= self.on;
        let mut changed = change.changed & !off | (state ^ self.recorded) & off;
        // Its change back to what the log shows is left out like those before.
        let back = change.changed & off & !changed;
        for number in Inputs(change.changed & self.on | back).numbers() {
            let bit = 1 << (number - 1);
            let Some(input) = self.inputs.get_mut(usize::from(number) - 1) else { continue };
            if back & bit != 0 {
                input.suppress(tick_ms);
            } else if self.chattering & bit != 0 || input.count(tick_ms) {
                self.chattering |= bit;
                input.suppress(tick_ms);
                changed &= !bit;
            }
        }
        // Inputs that come to rest in this very millisecond are in the same entry.
        changed |= self.come_to_rest(tick_ms);
        self.record(tick_ms, changed, record);
    }

    /// All changes up to `settled_ms` have been taken: inputs that were quiet for long enough then
    /// are recorded again.
    pub(crate) fn settle(&mut self, settled_ms: u64, mut record: impl FnMut(Change)) {
        while let Some(tick_ms) = self.next_rest_ms().filter(|&tick_ms| tick_ms <= settled_ms) {
            let changed = self.come_to_rest(tick_ms);
            self.record(tick_ms, changed, &mut record);
        }
        self.settled_ms = self.settled_ms.max(settled_ms);
    }

    /// When the next input that chatters will have been quiet for long enough.
    fn next_rest_ms(&self) -> Option<u64> {
        Inputs(self.chattering).numbers().filter_map(|number| self.rest_ms(number)).min()
    }

    fn rest_ms(&self, number: u8) -> Option<u64> {
        let input = self.inputs.get(usize::from(number).checked_sub(1)?)?;
        let rearm_ms = input.filter.map_or(0, |filter| filter.rearm_ms);
        // With a new filter the time may have passed already.
        Some((input.changed_ms + u64::from(rearm_ms)).max(self.settled_ms + 1))
    }

    /// Ends the chatter of all inputs that have been quiet for long enough at this tick. Returns
    /// those that are not as they were recorded last.
    fn come_to_rest(&mut self, tick_ms: u64) -> u32 {
        let mut changed = 0;
        for number in Inputs(self.chattering).numbers() {
            if self.rest_ms(number).is_some_and(|rest_ms| rest_ms <= tick_ms) {
                let bit = 1 << (number - 1);
                self.chattering &= !bit;
                changed |= (self.state ^ self.recorded) & bit;
                if let Some(input) = self.inputs.get_mut(usize::from(number) - 1) {
                    input.changes = 0;
                }
            }
        }
        changed
    }

    fn record(&mut self, tick_ms: u64, changed: u32, mut record: impl FnMut(Change)) {
        self.recorded = self.state & !self.chattering | self.recorded & self.chattering;
        if changed != 0 {
            record(Change { tick_ms, changed, state: self.recorded });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU8;

    use proptest::prelude::*;
    use ser_proto::InputFilter;

    use super::*;

    /// The filter of one input, millisecond by millisecond.
    #[derive(Default)]
    struct OneInput {
        on: bool,
        recorded: bool,
        chatters: bool,
        window_began_ms: Option<u64>,
        changes: u32,
        quiet_ms: u64,
        suppressed: u32,
    }

    impl OneInput {
        /// Whether the log shows a change in this millisecond.
        fn pass(&mut self, filter: Option<ChatterFilter>, tick_ms: u64, on: bool) -> bool {
            let changes = on != self.on;
            self.on = on;
            self.quiet_ms = if changes { 0 } else { self.quiet_ms + 1 };
            if let Some(filter) = filter
                && changes
                && !self.chatters
            {
                let goes_on = |began: &u64| tick_ms - began < u64::from(filter.window_ms);
                if self.window_began_ms.filter(goes_on).is_none() {
                    (self.window_began_ms, self.changes) = (Some(tick_ms), 0);
                }
                self.changes += 1;
                self.chatters = self.changes >= u32::from(filter.changes.get());
            } else if let Some(filter) = filter
                && self.chatters
                && self.quiet_ms >= u64::from(filter.rearm_ms)
            {
                (self.chatters, self.window_began_ms) = (false, None);
            }
            if self.chatters {
                self.suppressed += u32::from(changes);
                return false;
            }
            std::mem::replace(&mut self.recorded, on) != on
        }
    }

    /// Lets the inputs change at these ticks, and settles after each `every` milliseconds. Returns
    /// what is recorded, and how many changes were left out.
    fn filtered(
        filters: &[Option<ChatterFilter>],
        samples: &[u32],
        every: usize,
    ) -> (Vec<(u64, u32, u32)>, Vec<u32>) {
        let mut inputs = [Input::NEW; 32];
        let mut chatter = Chatter::new(&mut inputs);
        for (number, filter) in (1..).zip(filters) {
            chatter.set_filter(number, *filter);
        }
        let (mut recorded, mut state) = (Vec::new(), 0);
        for (tick_ms, &sample) in (1_u64..).zip(samples) {
            let mut record =
                |change: Change| recorded.push((change.tick_ms, change.changed, change.state));
            if sample != state {
                let changed = sample ^ state;
                state = sample;
                chatter.take(Change { tick_ms, changed, state }, &mut record);
            }
            if tick_ms % every as u64 == 0 {
                chatter.settle(tick_ms, &mut record);
            }
        }
        chatter.settle(samples.len() as u64, |change| {
            recorded.push((change.tick_ms, change.changed, change.state));
        });
        let suppressed = (1..).zip(filters).map(|(number, _)| chatter.suppressed(number));
        (recorded, suppressed.collect())
    }

    fn filter(changes: u8, window_ms: u16, rearm_ms: u16) -> Option<ChatterFilter> {
        NonZeroU8::new(changes).map(|changes| ChatterFilter { changes, window_ms, rearm_ms })
    }

    /// Also such as cannot be set: the filter does not depend on that.
    fn any_filter() -> impl Strategy<Value = Option<ChatterFilter>> {
        (prop_oneof![Just(0_u8), 2..6_u8], 1..60_u16, 1..60_u16)
            .prop_map(|(changes, window_ms, rearm_ms)| filter(changes, window_ms, rearm_ms))
    }

    proptest! {
        #[test]
        fn all_inputs_at_once_equal_one_input_at_a_time(
            filters in prop::collection::vec(any_filter(), 4),
            // Mostly quiet, so that chatter also ends.
            toggles in prop::collection::vec(
                prop_oneof![3 => Just(0_u32), 1 => 0..16_u32], 1..400
            ),
            quiet in prop::collection::vec((0..400_usize, 1..80_usize), 0..6),
            every in 1..50_usize,
        ) {
            let mut toggles = toggles;
            for (from, length) in quiet {
                toggles.iter_mut().skip(from).take(length).for_each(|toggles| *toggles = 0);
            }
            let samples: Vec<u32> = toggles
                .iter()
                .scan(0, |state, toggle| { *state ^= toggle; Some(*state) })
                .collect();
            let mut inputs: Vec<OneInput> = filters.iter().map(|_| OneInput::default()).collect();
            let mut expected = Vec::new();
            for (tick_ms, sample) in (1_u64..).zip(&samples) {
                let mut changed = 0;
                for (bit, (input, filter)) in inputs.iter_mut().zip(&filters).enumerate() {
                    let shows = input.pass(*filter, tick_ms, sample >> bit & 1 == 1);
                    changed |= u32::from(shows) << bit;
                }
                let state = inputs.iter().enumerate();
                let state = state.fold(0, |all, (bit, one)| all | u32::from(one.recorded) << bit);
                if changed != 0 {
                    expected.push((tick_ms, changed, state));
                }
            }
            let (recorded, suppressed) = filtered(&filters, &samples, every);
            prop_assert_eq!(recorded, expected);
            let left_out: Vec<u32> = inputs.iter().map(|input| input.suppressed).collect();
            prop_assert_eq!(suppressed, left_out);
        }
    }

    proptest! {
        #[test]
        fn an_input_that_operates_twice_in_a_second_is_never_taken_for_chatter(
            window_ms in 1..=7000_u16,
            more in 0..28_u8,
            rearm_ms: u16,
            // The four moments of a second at which it changes, the same in every second: so no
            // other second has more of them.
            moments in prop::collection::btree_set(0..1000_usize, 4),
            seconds in 1..20_usize,
        ) {
            let least = u8::try_from(1 + 4 * window_ms.div_ceil(1000)).unwrap();
            let chatter = filter((least + more).min(32), window_ms, rearm_ms.max(window_ms));
            let can_be_set = InputFilter { debounce_ms: 0, chatter }.check();
            prop_assert_eq!(can_be_set, Ok(()));
            let moments: Vec<usize> = moments.into_iter().collect();
            let mut samples = vec![0; seconds * 1000];
            for second in samples.chunks_mut(1000) {
                second[moments[0]..moments[1]].fill(1);
                second[moments[2]..moments[3]].fill(1);
            }
            let (recorded, suppressed) = filtered(&[chatter], &samples, 100);
            prop_assert_eq!(suppressed, [0]);
            prop_assert_eq!(recorded.len(), 4 * seconds);
        }
    }

    #[test]
    fn an_input_that_toggles_for_an_hour_costs_four_entries_and_a_count() {
        // Four changes are what an input makes that operates twice. The fifth shows that it is not
        // that.
        let filter = filter(5, 1000, 1000);
        // Every 20 ms for an hour; the last change opens it.
        let samples: Vec<u32> =
            (0..3_600_000 + 2000).map(|ms| u32::from(ms < 3_600_000 && ms / 20 % 2 == 1)).collect();
        let (recorded, suppressed) = filtered(&[filter], &samples, 7);
        assert_eq!(recorded, [(21, 1, 1), (41, 1, 0), (61, 1, 1), (81, 1, 0)]);
        assert_eq!(suppressed, [179_996], "it came to rest as it was recorded");
    }

    #[test]
    fn where_chatter_ends_the_log_shows_the_state_again() {
        let filter = filter(3, 100, 50);
        let mut samples = vec![0, 1, 0, 1, 0, 1];
        samples.extend([1; 60]);
        let (recorded, suppressed) = filtered(&[filter], &samples, 1);
        assert_eq!(recorded, [(2, 1, 1), (3, 1, 0), (56, 1, 1)], "50 ms after the last change");
        assert_eq!(suppressed, [3]);
    }

    #[test]
    fn a_filter_that_is_switched_off_lets_everything_through_again() {
        let mut inputs = [Input::NEW; 32];
        let mut chatter = Chatter::new(&mut inputs);
        chatter.baseline(0b10);
        chatter.set_filter(1, filter(2, 100, 9000));
        let mut seen = Vec::new();
        let mut take = |chatter: &mut Chatter<'_>, tick_ms, state| {
            let change = Change { tick_ms, changed: 1, state };
            chatter.take(change, |change| seen.push((change.tick_ms, change.state)));
        };
        take(&mut chatter, 10, 0b11);
        take(&mut chatter, 11, 0b10);
        take(&mut chatter, 12, 0b11);
        assert_eq!((chatter.chattering, chatter.suppressed(1)), (1, 2));
        chatter.set_filter(1, None);
        take(&mut chatter, 13, 0b10);
        take(&mut chatter, 14, 0b11);
        assert_eq!(seen, [(10, 0b11), (13, 0b10), (14, 0b11)]);
        assert_eq!((chatter.chattering, chatter.suppressed(1)), (0, 2));
    }

    #[test]
    fn a_change_back_to_what_the_log_shows_is_counted_when_the_filter_is_switched_off() {
        let mut inputs = [Input::NEW; 32];
        let mut chatter = Chatter::new(&mut inputs);
        chatter.set_filter(1, filter(2, 100, 9000));
        let mut seen = Vec::new();
        let mut take = |chatter: &mut Chatter<'_>, tick_ms, state| {
            let change = Change { tick_ms, changed: 1, state };
            chatter.take(change, |change| seen.push((change.tick_ms, change.state)));
        };
        take(&mut chatter, 10, 1);
        take(&mut chatter, 11, 0);
        chatter.settle(11, |_| {});
        chatter.set_filter(1, None);
        // The log shows the input as on, and on it is: of two changes it shows neither.
        take(&mut chatter, 12, 1);
        take(&mut chatter, 13, 0);
        assert_eq!(seen, [(10, 1), (13, 0)]);
        assert_eq!((chatter.chattering, chatter.suppressed(1)), (0, 2));
    }
}
