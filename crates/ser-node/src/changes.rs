//! The changes of the inputs on their way from capture to the log. They come out in order, and only
//! when the clock and mode of their millisecond are known.

use ser_proto::InputFilter;

use crate::capture::CaptureReader;
use crate::chatter::{self, Chatter};
use crate::debounce::Debounce;
use crate::sequencer::{Change, Place, Sequencer, WINDOW};
use crate::ticks::Ticks;

/// The main loop's end of the capture channel, the sequencer that orders its samples, and the
/// filter that leaves chatter out.
pub(crate) struct Changes<'a> {
    capture: CaptureReader<'a>,
    ticks: Ticks,
    sequencer: Sequencer<'a>,
    chatter: Chatter<'a>,
    /// The inputs that the recorder has.
    mask: u32,
    has_begun: bool,
    debounce: DebounceChange,
}

/// Debounce times: of the samples that are read now, those that capture has taken over since, and
/// those that are wanted.
struct DebounceChange {
    in_force: Debounce,
    taken: Option<Debounce>,
    wanted: Debounce,
}

impl<'a> Changes<'a> {
    pub(crate) fn new(
        capture: CaptureReader<'a>,
        mask: u32,
        waiting: &'a mut [Place; WINDOW],
        chatter: &'a mut [chatter::Input; 32],
    ) -> Changes<'a> {
        let in_force = *capture.debounce();
        Changes {
            capture,
            ticks: Ticks::new(),
            sequencer: Sequencer::new(in_force, waiting),
            chatter: Chatter::new(chatter),
            mask,
            has_begun: false,
            debounce: DebounceChange { in_force, taken: None, wanted: in_force },
        }
    }

    /// From now on these filters hold, by input.
    pub(crate) fn set_filters(&mut self, filters: &[InputFilter]) {
        self.debounce.wanted = Debounce::OFF;
        for (number, filter) in (1..).zip(filters) {
            self.debounce.wanted = self.debounce.wanted.with(number, filter.debounce_ms);
            self.chatter.set_filter(number, filter.chatter);
        }
    }

    /// The filter for inputs that chatter.
    pub(crate) fn chatter(&self) -> &Chatter<'a> {
        &self.chatter
    }

    /// The debounce times that capture has to take over; `None` if it has them, or is about to show
    /// that it has others.
    pub(crate) fn debounce_change(&self) -> Option<Debounce> {
        let DebounceChange { in_force, taken, wanted } = self.debounce;
        (taken.is_none() && wanted != in_force).then_some(wanted)
    }

    /// Capture has taken these times over. A sample says from where on.
    pub(crate) fn debounce_changed(&mut self, debounce: Debounce) {
        self.debounce.taken = Some(debounce);
    }

    /// The main loop's end of capture: its counters and the present inputs.
    pub(crate) fn capture(&self) -> &CaptureReader<'a> {
        &self.capture
    }

    /// The 64-bit tick that a tick of the interrupt stands for.
    pub(crate) fn extend(&mut self, tick_ms: u32) -> u64 {
        self.ticks.extend(tick_ms)
    }

    /// The tick of the latest sample.
    pub(crate) fn now_ms(&mut self) -> u64 {
        self.ticks.extend(self.capture.tick_ms())
    }

    /// Holds back changes after this tick, for as long as there is room.
    pub(crate) fn hold_after(&mut self, tick_ms: Option<u32>) {
        let tick_ms = tick_ms.map(|tick_ms| self.ticks.extend(tick_ms));
        self.sequencer.hold_after(tick_ms);
    }

    /// Whether a change that began after this tick has been handed on.
    pub(crate) fn is_past(&self, tick_ms: u64) -> bool {
        self.sequencer.is_past(tick_ms)
    }

    /// Hands on the changes of all samples up to `until_ms`, in the order in which they began.
    pub(crate) fn take_until(&mut self, until_ms: u64, mut record: impl FnMut(Change)) {
        let Changes { capture, ticks, sequencer, chatter, mask, has_begun, debounce } = self;
        while let Some(sample) = capture.next_if(|sample| ticks.extend(sample.tick_ms) <= until_ms)
        {
            let tick_ms = ticks.extend(sample.tick_ms);
            while let Some(change) = sequencer.next(tick_ms) {
                chatter.take(change, &mut record);
            }
            if !*has_begun {
                *has_begun = true;
                sequencer.baseline(sample.state & *mask);
                chatter.baseline(sample.state & *mask);
            } else if sample.changed == 0 {
                // What capture had to drop shows in the state, and began by the old times.
                sequencer.push(tick_ms, 0, sample.state & *mask);
                if let Some(taken) = debounce.taken.take() {
                    debounce.in_force = taken;
                    sequencer.change_debounce(taken);
                }
            } else if sample.changed & *mask != 0 {
                sequencer.push(tick_ms, sample.changed & *mask, sample.state & *mask);
            }
        }
        while let Some(change) = sequencer.next(until_ms + 1) {
            chatter.take(change, &mut record);
        }
        chatter.settle(sequencer.settled_ms(), record);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::CaptureChannel;
    use crate::capture::DebounceTimes;
    use crate::sequencer::tests::expected;

    /// Runs samples through capture and the main loop, which looks at every `every`-th sample only.
    /// From the sample `at` on it wants other debounce times. Returns the changes, and from which
    /// sample on the other times are in force.
    fn changes(
        (debounce, other, at): (Debounce, Debounce, usize),
        samples: &[u32],
        every: usize,
    ) -> (Vec<(u64, u32)>, usize) {
        let mut channel = CaptureChannel::new();
        let (mut capture, reader) = channel.split(debounce);
        let (mut places, mut inputs) = ([Place::EMPTY; WINDOW], [chatter::Input::NEW; 32]);
        let mut main_loop = Changes::new(reader, u32::MAX, &mut places, &mut inputs);
        let (mut seen, mut in_force) = (Vec::new(), usize::MAX);
        let settling = std::iter::repeat_n(*samples.last().unwrap_or(&0), 3 * 256);
        for (index, inputs) in samples.iter().copied().chain(settling).enumerate() {
            let tick_ms = u32::try_from(index).unwrap() + 1;
            capture.sample(tick_ms, inputs);
            if index == at {
                let times = (1..=32).map(|number| other.time_ms(number));
                let filters = times.map(|debounce_ms| InputFilter { debounce_ms, chatter: None });
                main_loop.set_filters(&filters.collect::<Vec<_>>());
            }
            if let Some(wanted) = main_loop.debounce_change()
                && capture.take_times(&DebounceTimes::new(&wanted))
            {
                main_loop.debounce_changed(wanted);
                in_force = index + 1;
            }
            if (index + 1).is_multiple_of(every) {
                main_loop.take_until(u64::from(tick_ms), |change| {
                    seen.push((change.tick_ms, change.changed));
                });
            }
        }
        let end = u64::try_from(samples.len()).unwrap() + 3 * 256;
        main_loop.take_until(end, |change| seen.push((change.tick_ms, change.changed)));
        (seen, in_force)
    }

    proptest! {
        #[test]
        fn debounce_times_change_on_the_run_and_every_change_keeps_its_first_moment(
            times in prop::collection::vec((1..=32_u8, any::<u8>()), 0..8),
            others in prop::collection::vec((1..=32_u8, prop_oneof![Just(0), any::<u8>()]), 1..8),
            at in 0..400_usize,
            runs in prop::collection::vec((any::<u32>(), 1..40_usize), 1..40),
            every in 1..8_usize,
        ) {
            let with = |all: Debounce, &(number, time): &(u8, u8)| all.with(number, time);
            let debounce = times.iter().fold(Debounce::OFF, with);
            let other = others.iter().fold(debounce, with);
            let samples: Vec<u32> =
                runs.iter().flat_map(|&(inputs, times)| std::iter::repeat_n(inputs, times)).collect();
            let (seen, in_force) = changes((debounce, other, at), &samples, every);
            let time_ms = |index: usize, number: u8| {
                if index < in_force { debounce } else { other }.time_ms(number)
            };
            prop_assert_eq!(seen, expected(time_ms, &samples));
            prop_assert!(in_force < usize::MAX || debounce == other);
        }
    }
}
