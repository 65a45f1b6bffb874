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
    /// All changes up to this millisecond have been taken.
    settled_ms: u64,
}

impl ChatterModel {
    /// Sets the filter of an input (0–31). If it chatters, it does so until it has been quiet for the
    /// new time, or up to the next millisecond that is not settled if there is no filter any more.
    pub fn set(&mut self, bit: usize, filter: Option<ChatterFilter>) {
        let input = &mut self.inputs[bit];
        if input.filter != filter {
            (input.filter, input.window) = (filter, None);
        }
    }

    /// All changes up to this millisecond have been taken.
    pub fn settled(&mut self, until_ms: u64) {
        self.settled_ms = self.settled_ms.max(until_ms);
    }

    /// Ends the chatter of inputs whose filter was switched off, and returns them. The log shows the
    /// next of each that it does not show yet.
    pub fn end_switched_off(&mut self) -> u32 {
        let mut ended = 0;
        for (bit, input) in self.inputs.iter_mut().enumerate() {
            if input.chatters && input.filter.is_none() {
                input.chatters = false;
                ended |= 1 << bit;
            }
        }
        ended
    }

    /// A change of an input came to nothing: the log already showed the state to which it led.
    pub fn leave_out(&mut self, bit: usize) {
        self.inputs[bit].left_out += 1;
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
        self.inputs.iter().filter_map(|input| input.rest_ms(self.settled_ms)).min()
    }

    /// Inputs that have been quiet for long enough in this millisecond. They chatter no longer.
    pub fn rest(&mut self, at_ms: u64) -> u32 {
        let (mut rested, settled_ms) = (0, self.settled_ms);
        for (bit, input) in self.inputs.iter_mut().enumerate() {
            if input.rest_ms(settled_ms).is_some_and(|rest_ms| rest_ms <= at_ms) {
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
    /// When it comes to rest, if it chatters. With a new filter that may be past already; what is
    /// settled stays as it is.
    fn rest_ms(&self, settled_ms: u64) -> Option<u64> {
        let rearm_ms = self.filter.map_or(0, |filter| filter.rearm_ms);
        let rest_ms = (self.changed_ms + u64::from(rearm_ms)).max(settled_ms + 1);
        self.chatters.then_some(rest_ms)
    }
}
