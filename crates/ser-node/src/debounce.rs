//! The per-input debounce filter: a change counts when the input has held its new state long
//! enough.
//!
//! Bit-parallel counters filter all inputs together: plane `p` holds bit `p` of every input's
//! counter. One pass over the planes counts for 32 inputs, and the work is the same whatever the
//! inputs do.

/// Counters are eight bits wide, so debounce times reach 255 ms.
const PLANES: usize = 8;

/// Debounce time of every input, in milliseconds; 0 switches it off.
///
/// With `n` milliseconds, an input must stay in its new state for `n` ms before the change is
/// recorded. The event carries the time at which the new state was first seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Debounce {
    times_ms: [u8; 32],
}

impl Debounce {
    /// No filter: every change counts at once.
    pub const OFF: Debounce = Debounce::uniform(0);

    /// The same time for every input.
    #[must_use]
    pub const fn uniform(time_ms: u8) -> Debounce {
        Debounce { times_ms: [time_ms; 32] }
    }

    /// The same times, but with `time_ms` for input `number` (1–32). Other numbers change nothing.
    #[must_use]
    pub fn with(mut self, number: u8, time_ms: u8) -> Debounce {
        if let Some(time) =
            usize::from(number).checked_sub(1).and_then(|index| self.times_ms.get_mut(index))
        {
            *time = time_ms;
        }
        self
    }

    /// The time of input `number` (1–32); 0 for other numbers.
    #[must_use]
    pub fn time_ms(&self, number: u8) -> u8 {
        usize::from(number)
            .checked_sub(1)
            .and_then(|index| self.times_ms.get(index))
            .copied()
            .unwrap_or(0)
    }

    /// The longest of all times.
    #[must_use]
    pub fn longest_ms(&self) -> u8 {
        self.times_ms.iter().copied().max().unwrap_or(0)
    }
}

/// One bit of the counter of every input.
///
/// A counter starts at 256 minus the time and counts up. The stored bits are the difference from
/// that start, so that a mask restarts the counter.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    moved: u32,
    start: u32,
}

impl Plane {
    /// Adds the carry to the counters that are `counting` and restarts the others. Returns the
    /// carry for the next plane.
    #[inline]
    fn count(&mut self, counting: u32, carry: u32) -> u32 {
        let counter = self.moved ^ self.start;
        self.moved = (self.moved ^ carry) & counting;
        carry & counter
    }
}

/// The filter at work: one step per sample.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    accepted: u32,
    planes: [Plane; PLANES],
    /// Inputs that have held their new state for their time. One more sample of it, and the change
    /// is accepted.
    due: u32,
    /// Inputs without a debounce time, which are always due.
    without: u32,
}

impl Filter {
    /// A filter that starts with `inputs` as the accepted state.
    pub(crate) fn new(debounce: &Debounce, inputs: u32) -> Filter {
        let mut planes = [Plane::default(); PLANES];
        let mut without = 0;
        for (input, time_ms) in debounce.times_ms.iter().enumerate() {
            // 256 minus the time, without the ninth bit.
            let start = time_ms.wrapping_neg();
            without |= u32::from(start == 0) << input;
            for (bit, plane) in planes.iter_mut().enumerate() {
                plane.start |= u32::from(start >> bit & 1) << input;
            }
        }
        Filter { accepted: inputs, planes, due: without, without }
    }

    /// The state that has been accepted.
    pub(crate) const fn accepted(&self) -> u32 {
        self.accepted
    }

    /// Takes over the times of another filter. Inputs whose time stays go on counting. False, and
    /// nothing changes, while an input counts whose time would change: the change that it may
    /// become began by the old time.
    pub(crate) fn take_times(&mut self, other: &Filter) -> bool {
        let (mut counting, mut others) = (0, 0);
        for (plane, other) in self.planes.iter().zip(&other.planes) {
            counting |= plane.moved;
            others |= plane.start ^ other.start;
        }
        if counting & others != 0 {
            return false;
        }
        for (plane, other) in self.planes.iter_mut().zip(&other.planes) {
            plane.start = other.start;
        }
        self.due = self.due & !others | other.without & others;
        self.without = other.without;
        true
    }

    /// Whether no input has a debounce time, so that repeating a sample changes nothing.
    pub(crate) const fn is_off(&self) -> bool {
        self.without == u32::MAX
    }

    /// Takes the next sample; returns the inputs whose change has just been accepted.
    #[inline]
    pub(crate) fn step(&mut self, inputs: u32) -> u32 {
        let differ = inputs ^ self.accepted;
        let accepted = differ & self.due;
        self.accepted ^= accepted;
        if !self.is_off() {
            let counting = differ ^ accepted;
            // Unrolled by hand: this is half of the capture interrupt, and a loop would take half
            // as long again.
            let [a, b, c, d, e, f, g, h] = &mut self.planes;
            let carry = a.count(counting, counting);
            let carry = b.count(counting, carry);
            let carry = c.count(counting, carry);
            let carry = d.count(counting, carry);
            let carry = e.count(counting, carry);
            let carry = f.count(counting, carry);
            let carry = g.count(counting, carry);
            self.due = h.count(counting, carry) | self.without;
        }
        accepted
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A plain filter for one input, as the reference: how long has the new state lasted?
    struct OneInput {
        time_ms: u8,
        accepted: bool,
        lasted: u32,
    }

    impl OneInput {
        fn step(&mut self, on: bool) -> bool {
            self.lasted = if on == self.accepted { 0 } else { self.lasted + 1 };
            let accept = self.lasted > u32::from(self.time_ms);
            if accept {
                self.accepted = on;
                self.lasted = 0;
            }
            accept
        }
    }

    proptest! {
        #[test]
        fn thirty_two_inputs_at_once_equal_one_input_at_a_time(
            times in prop::array::uniform32(prop_oneof![Just(0_u8), 1..4_u8, any::<u8>()]),
            start: u32,
            // Runs of equal samples, so that long debounce times are also reached.
            runs in prop::collection::vec((any::<u32>(), 1..300_usize), 0..40),
        ) {
            let debounce = Debounce { times_ms: times };
            let mut filter = Filter::new(&debounce, start);
            let mut inputs: Vec<_> = (0..32)
                .map(|bit| OneInput { time_ms: times[bit], accepted: start >> bit & 1 == 1, lasted: 0 })
                .collect();
            for (sample, times) in runs {
                for _ in 0..times {
                    let mut expected = 0;
                    for (bit, input) in inputs.iter_mut().enumerate() {
                        expected |= u32::from(input.step(sample >> bit & 1 == 1)) << bit;
                    }
                    prop_assert_eq!(filter.step(sample), expected);
                }
            }
        }
    }

    #[test]
    fn without_a_time_every_change_counts_at_once() {
        let mut filter = Filter::new(&Debounce::OFF, 0);
        assert!(filter.is_off());
        assert_eq!(filter.step(0b101), 0b101);
        assert_eq!(filter.step(0b001), 0b100);
        assert_eq!(filter.step(0b001), 0);
    }

    #[test]
    fn with_three_milliseconds_the_fourth_sample_counts_and_a_bounce_starts_anew() {
        let mut filter = Filter::new(&Debounce::OFF.with(1, 3), 0);
        let bounce = [1, 1, 1, 0, 1, 1, 1, 1, 1];
        let accepted = bounce.map(|sample| filter.step(sample));
        assert_eq!(accepted, [0, 0, 0, 0, 0, 0, 0, 1, 0]);
        assert_eq!(filter.accepted(), 1);
    }

    #[test]
    fn times_change_only_for_inputs_that_are_not_counting() {
        let mut filter = Filter::new(&Debounce::OFF.with(1, 3).with(2, 2), 0);
        let other = Filter::new(&Debounce::OFF.with(1, 3).with(2, 1), 0);
        assert_eq!(filter.step(0b011), 0);
        assert!(!filter.take_times(&other), "input 2 is counting");
        assert_eq!(filter.step(0b001), 0);
        assert!(filter.take_times(&other), "input 1 is counting and keeps its time");
        assert_eq!([0b011, 0b011].map(|sample| filter.step(sample)), [0, 0b011]);
        assert!(filter.take_times(&Filter::new(&Debounce::OFF, 0)));
        assert!(filter.is_off());
        assert_eq!(filter.step(0), 0b011);
    }

    #[test]
    fn inputs_that_do_not_exist_have_no_time() {
        let debounce = Debounce::OFF.with(0, 9).with(33, 9).with(32, 7);
        assert_eq!((debounce.time_ms(0), debounce.time_ms(33), debounce.time_ms(32)), (0, 0, 7));
        assert_eq!(debounce.longest_ms(), 7);
    }
}
