//! The chatter filter: a contact that moves too often is left out of the log until it is quiet.
//!
//! It stands behind the sequencer, in the main loop, and sees changes in the order in which they
//! began. Every change up to the one by which chatter is recognised is recorded as it is. From there
//! on the log shows the input as it was last recorded, and its changes are counted. When it has been
//! quiet for its re-arm time, an entry of that moment shows where it came to rest, if that differs.

use ser_proto::Inputs;

use crate::sequencer::Change;

/// When an input chatters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChatterRule {
    /// With so many changes in one window an input chatters; 0 switches the filter off.
    pub changes: u8,
    /// The length of the window, in milliseconds. It begins with the first change outside of the
    /// one before.
    pub window_ms: u16,
    /// For how long an input must be quiet until it is recorded again, in milliseconds.
    pub rearm_ms: u16,
}

/// The filter at work, for all inputs.
pub(crate) struct Chatter {
    inputs: [Input; 32],
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
struct Input {
    rule: ChatterRule,
    /// When its window began, and how many changes there were since.
    window_began_ms: u64,
    changes: u8,
    /// When it changed last.
    changed_ms: u64,
    /// How many of its changes were left out since power-up.
    suppressed: u32,
}

impl Input {
    const NEW: Input = Input {
        rule: ChatterRule { changes: 0, window_ms: 0, rearm_ms: 0 },
        window_began_ms: 0,
        changes: 0,
        changed_ms: 0,
        suppressed: 0,
    };

    /// Takes a change. Whether it is the one by which chatter is recognised.
    fn count(&mut self, tick_ms: u64) -> bool {
        let is_over = tick_ms - self.window_began_ms >= u64::from(self.rule.window_ms);
        if is_over || self.changes == 0 {
            self.window_began_ms = tick_ms;
            self.changes = 0;
        }
        self.changes = self.changes.saturating_add(1);
        self.changed_ms = tick_ms;
        self.changes >= self.rule.changes
    }

    /// Takes a change that is left out.
    fn suppress(&mut self, tick_ms: u64) {
        self.changed_ms = tick_ms;
        self.suppressed = self.suppressed.saturating_add(1);
    }
}

impl Chatter {
    pub(crate) const fn new() -> Chatter {
        Chatter {
            inputs: [Input::NEW; 32],
            on: 0,
            chattering: 0,
            state: 0,
            recorded: 0,
            settled_ms: 0,
        }
    }

    /// Takes the state of the inputs before any change.
    pub(crate) fn baseline(&mut self, state: u32) {
        (self.state, self.recorded) = (state, state);
    }

    /// From now on this rule holds for input `number` (1–32). An input that chatters does so until
    /// it has been quiet for the new re-arm time; without a filter it ends at once.
    pub(crate) fn set_rule(&mut self, number: u8, rule: ChatterRule) {
        let index = usize::from(number).wrapping_sub(1);
        let Some(input) = self.inputs.get_mut(index) else { return };
        input.rule = match rule.changes {
            0 => ChatterRule::default(),
            _ => rule,
        };
        input.changes = 0;
        self.on = self.on & !(1 << index) | u32::from(rule.changes > 0) << index;
    }

    /// The inputs that chatter now.
    pub(crate) const fn chattering(&self) -> u32 {
        self.chattering
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
        for number in Inputs(change.changed & self.on).numbers() {
            let bit = 1 << (number - 1);
            let Some(input) = self.inputs.get_mut(usize::from(number) - 1) else { continue };
            if self.chattering & bit != 0 || input.count(tick_ms) {
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
        // With a new rule the time may have passed already.
        Some((input.changed_ms + u64::from(input.rule.rearm_ms)).max(self.settled_ms + 1))
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
    use proptest::prelude::*;

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
        fn pass(&mut self, rule: ChatterRule, tick_ms: u64, on: bool) -> bool {
            let changes = on != self.on;
            self.on = on;
            self.quiet_ms = if changes { 0 } else { self.quiet_ms + 1 };
            if rule.changes > 0 && changes && !self.chatters {
                let goes_on = |began: &u64| tick_ms - began < u64::from(rule.window_ms);
                if self.window_began_ms.filter(goes_on).is_none() {
                    (self.window_began_ms, self.changes) = (Some(tick_ms), 0);
                }
                self.changes += 1;
                self.chatters = self.changes >= u32::from(rule.changes);
            } else if self.chatters && self.quiet_ms >= u64::from(rule.rearm_ms) {
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
        rules: &[ChatterRule],
        samples: &[u32],
        every: usize,
    ) -> (Vec<(u64, u32, u32)>, Vec<u32>) {
        let mut chatter = Chatter::new();
        for (number, rule) in (1..).zip(rules) {
            chatter.set_rule(number, *rule);
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
        let suppressed = (1..).zip(rules).map(|(number, _)| chatter.suppressed(number));
        (recorded, suppressed.collect())
    }

    fn rule() -> impl Strategy<Value = ChatterRule> {
        (prop_oneof![Just(0_u8), 2..6_u8], 1..60_u16, 1..60_u16)
            .prop_map(|(changes, window_ms, rearm_ms)| ChatterRule { changes, window_ms, rearm_ms })
    }

    proptest! {
        #[test]
        fn all_inputs_at_once_equal_one_input_at_a_time(
            rules in prop::collection::vec(rule(), 4),
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
            let mut inputs: Vec<OneInput> = rules.iter().map(|_| OneInput::default()).collect();
            let mut expected = Vec::new();
            for (tick_ms, sample) in (1_u64..).zip(&samples) {
                let mut changed = 0;
                for (bit, (input, rule)) in inputs.iter_mut().zip(&rules).enumerate() {
                    let shows = input.pass(*rule, tick_ms, sample >> bit & 1 == 1);
                    changed |= u32::from(shows) << bit;
                }
                let state = inputs.iter().enumerate();
                let state = state.fold(0, |all, (bit, one)| all | u32::from(one.recorded) << bit);
                if changed != 0 {
                    expected.push((tick_ms, changed, state));
                }
            }
            let (recorded, suppressed) = filtered(&rules, &samples, every);
            prop_assert_eq!(recorded, expected);
            let left_out: Vec<u32> = inputs.iter().map(|input| input.suppressed).collect();
            prop_assert_eq!(suppressed, left_out);
        }
    }

    #[test]
    fn an_input_that_toggles_for_an_hour_costs_two_entries_and_a_count() {
        let rule = ChatterRule { changes: 3, window_ms: 100, rearm_ms: 1000 };
        // Every 20 ms for an hour; the last change opens it.
        let samples: Vec<u32> =
            (0..3_600_000 + 2000).map(|ms| u32::from(ms < 3_600_000 && ms / 20 % 2 == 1)).collect();
        let (recorded, suppressed) = filtered(&[rule], &samples, 7);
        assert_eq!(recorded, [(21, 1, 1), (41, 1, 0)], "it came to rest as it was recorded");
        assert_eq!(suppressed, [179_998]);
    }

    #[test]
    fn where_chatter_ends_the_log_shows_the_state_again() {
        let rule = ChatterRule { changes: 3, window_ms: 100, rearm_ms: 50 };
        let mut samples = vec![0, 1, 0, 1, 0, 1];
        samples.extend([1; 60]);
        let (recorded, suppressed) = filtered(&[rule], &samples, 1);
        assert_eq!(recorded, [(2, 1, 1), (3, 1, 0), (56, 1, 1)], "50 ms after the last change");
        assert_eq!(suppressed, [3]);
    }

    #[test]
    fn a_filter_that_is_switched_off_lets_everything_through_again() {
        let mut chatter = Chatter::new();
        chatter.baseline(0b10);
        chatter.set_rule(1, ChatterRule { changes: 2, window_ms: 100, rearm_ms: 9000 });
        let mut seen = Vec::new();
        let mut take = |chatter: &mut Chatter, tick_ms, state| {
            let change = Change { tick_ms, changed: 1, state };
            chatter.take(change, |change| seen.push((change.tick_ms, change.state)));
        };
        take(&mut chatter, 10, 0b11);
        take(&mut chatter, 11, 0b10);
        take(&mut chatter, 12, 0b11);
        assert_eq!((chatter.chattering(), chatter.suppressed(1)), (1, 2));
        chatter.set_rule(1, ChatterRule::default());
        take(&mut chatter, 13, 0b10);
        take(&mut chatter, 14, 0b11);
        assert_eq!(seen, [(10, 0b11), (13, 0b10), (14, 0b11)]);
        assert_eq!((chatter.chattering(), chatter.suppressed(1)), (0, 2));
    }
}
