//! Debounce in its simplest form: a change counts when the input has stayed in its new state long
//! enough, and it happened when the input went there.

use ser_node::Debounce;

/// One input.
#[derive(Clone, Copy, Debug, Default)]
struct Input {
    accepted: bool,
    now: bool,
    since_ms: u64,
}

/// All inputs.
#[derive(Clone, Debug)]
pub struct DebounceModel {
    debounce: Debounce,
    inputs: [Input; 32],
    /// Inputs that are not in the state that was accepted last.
    unsettled: u32,
    /// Changes that came to nothing.
    filtered: u64,
}

/// A change that counts: input (0–31) and when it happened.
pub type Accepted = (u8, u64);

impl DebounceModel {
    /// Inputs that have always been in these states.
    #[must_use]
    pub fn new(debounce: Debounce, state: u32) -> DebounceModel {
        let mut inputs = [Input::default(); 32];
        for (bit, input) in inputs.iter_mut().enumerate() {
            let on = state >> bit & 1 == 1;
            *input = Input { accepted: on, now: on, since_ms: 0 };
        }
        DebounceModel { debounce, inputs, unsettled: 0, filtered: 0 }
    }

    /// The times in force.
    #[must_use]
    pub fn times(&self) -> &Debounce {
        &self.debounce
    }

    /// Takes these times over, unless an input has begun to change whose time would be another one.
    pub fn take_times(&mut self, debounce: &Debounce) {
        let other = |bit: u8| debounce.time_ms(bit + 1) != self.debounce.time_ms(bit + 1);
        let is_counting = |bit: u8| self.unsettled >> bit & 1 == 1;
        if !(0..32).any(|bit| is_counting(bit) && other(bit)) {
            self.debounce = *debounce;
        }
    }

    /// Inputs change in this millisecond. `out` gets what was accepted before.
    pub fn change(&mut self, at_ms: u64, changed: u32, out: &mut Vec<Accepted>) {
        self.settle(at_ms.saturating_sub(1), out);
        for bit in (0..32_u8).filter(|bit| changed >> bit & 1 == 1) {
            let input = &mut self.inputs[usize::from(bit)];
            input.now = !input.now;
            if input.now == input.accepted {
                // The input went there and back again.
                self.filtered += 2;
            }
            input.since_ms = at_ms;
            self.unsettled =
                self.unsettled & !(1 << bit) | u32::from(input.now != input.accepted) << bit;
        }
    }

    /// Adds what has been accepted once the sample of `now_ms` has been taken.
    pub fn settle(&mut self, now_ms: u64, out: &mut Vec<Accepted>) {
        if self.unsettled == 0 {
            return;
        }
        for bit in 0..32_u8 {
            let input = &mut self.inputs[usize::from(bit)];
            let time_ms = u64::from(self.debounce.time_ms(bit + 1));
            if input.now != input.accepted && input.since_ms + time_ms <= now_ms {
                input.accepted = input.now;
                self.unsettled &= !(1 << bit);
                out.push((bit, input.since_ms));
            }
        }
    }

    /// Inputs change without anybody seeing it.
    pub fn follow(&mut self, changed: u32) {
        for bit in (0..32_u8).filter(|bit| changed >> bit & 1 == 1) {
            let input = &mut self.inputs[usize::from(bit)];
            input.now = !input.now;
            input.accepted = !input.accepted;
        }
    }

    /// Changes that came to nothing, because the input went back too soon.
    #[must_use]
    pub fn filtered(&self) -> u64 {
        self.filtered
    }

    /// How many inputs are in a state that has not been accepted yet.
    #[must_use]
    pub fn unsettled(&self) -> u64 {
        self.unsettled.count_ones().into()
    }
}
