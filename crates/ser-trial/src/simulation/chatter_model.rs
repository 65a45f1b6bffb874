//! The chatter filter in its simplest form, one input after the other: so many changes in a window
//! are chatter, which is left out and counted until the input has been quiet for long enough.

use ser_proto::ChatterFilter;

/// One input.
#[derive(Clone, Copy, Debug, Default)]
struct Input {
    filter: Option<ChatterFilter>,
    /// When the window began, and how many changes there were in it.
    window: Option<(u64, u32)>,
    changed_ms: u64,
    chatters: bool,
    left_out: u32,
}

/// All inputs.
#[derive(Clone, Debug, Default)]
pub struct ChatterModel {
    inputs: [Input; 32],
}

impl ChatterModel {
    /// Sets the filter of an input (0–31) that does not chatter.
    pub fn set(&mut self, bit: usize, filter: Option<ChatterFilter>) {
        let input = &mut self.inputs[bit];
        if input.filter != filter {
            (input.filter, input.window) = (filter, None);
        }
    }

    /// An input changes. Whether the log shows it.
    pub fn change(&mut self, bit: usize, at_ms: u64) -> bool {
        let input = &mut self.inputs[bit];
        let Some(filter) = input.filter else { return true };
        input.changed_ms = at_ms;
        if !input.chatters {
            let goes_on = |&(from_ms, _): &(u64, u32)| at_ms - from_ms < filter.window_ms.into();
            let (from_ms, changes) = input.window.filter(goes_on).unwrap_or((at_ms, 0));
            input.window = Some((from_ms, changes + 1));
            input.chatters = changes + 1 >= filter.changes.get().into();
        }
        input.left_out += u32::from(input.chatters);
        !input.chatters
    }

    /// Inputs that chatter.
    #[must_use]
    pub fn chattering(&self) -> u32 {
        let inputs = self.inputs.iter().enumerate();
        inputs.fold(0, |all, (bit, input)| all | u32::from(input.chatters) << bit)
    }

    /// When the next input will have been quiet for long enough.
    #[must_use]
    pub fn next_rest_ms(&self) -> Option<u64> {
        self.inputs.iter().filter_map(Input::rest_ms).min()
    }

    /// Inputs that have been quiet for long enough in this millisecond. They chatter no longer.
    pub fn rest(&mut self, at_ms: u64) -> u32 {
        let mut rested = 0;
        for (bit, input) in self.inputs.iter_mut().enumerate() {
            if input.rest_ms().is_some_and(|rest_ms| rest_ms <= at_ms) {
                (input.chatters, input.window) = (false, None);
                rested |= 1 << bit;
            }
        }
        rested
    }

    /// How many changes of each input were left out.
    #[must_use]
    pub fn left_out(&self) -> [u32; 32] {
        self.inputs.map(|input| input.left_out)
    }
}

impl Input {
    fn rest_ms(&self) -> Option<u64> {
        let rearm_ms = self.filter.filter(|_| self.chatters)?.rearm_ms;
        Some(self.changed_ms + u64::from(rearm_ms))
    }
}
