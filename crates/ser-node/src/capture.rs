//! The interrupt's half of the recorder: read all inputs, filter, compare, queue.
//!
//! [`Capture::sample`] runs once per millisecond at the highest priority and waits for nothing. It
//! hands changes to the main loop through a queue. A change that finds the queue full is counted.
//! The main loop notices from the states that a change is missing.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::debounce::{Debounce, Filter};
use crate::ring::{Reader, Ring, Slot, Writer};

/// Changes that may wait for the main loop: a quarter of a second with a change every millisecond.
/// A power of two, as a ring requires.
pub const QUEUE_LEN: usize = 256;

/// Inputs that changed in one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct Sample {
    /// When, in milliseconds since power-up, wrapping.
    pub(crate) tick_ms: u32,
    /// The inputs that changed. Empty in the very first sample, which is the baseline, and in one
    /// that says that other debounce times are in force from here on.
    pub(crate) changed: u32,
    /// The inputs that are on.
    pub(crate) state: u32,
}

impl Slot for Sample {
    type Cell = [AtomicU32; 3];
    const EMPTY: [AtomicU32; 3] = [const { AtomicU32::new(0) }; 3];

    #[inline]
    fn store(self, [tick_ms, changed, state]: &[AtomicU32; 3]) {
        tick_ms.store(self.tick_ms, Ordering::Relaxed);
        changed.store(self.changed, Ordering::Relaxed);
        state.store(self.state, Ordering::Relaxed);
    }

    #[inline]
    fn load([tick_ms, changed, state]: &[AtomicU32; 3]) -> Sample {
        Sample {
            tick_ms: tick_ms.load(Ordering::Relaxed),
            changed: changed.load(Ordering::Relaxed),
            state: state.load(Ordering::Relaxed),
        }
    }
}

/// What the interrupt and the main loop share.
pub struct CaptureChannel {
    queue: Ring<Sample, QUEUE_LEN>,
    shared: Shared,
}

#[derive(Default)]
struct Shared {
    tick_ms: AtomicU32,
    /// The inputs that are on after debounce, whether or not the queue had room for the change.
    state: AtomicU32,
    edges_lost: AtomicU32,
    samples_missed: AtomicU32,
}

impl CaptureChannel {
    /// An empty channel, for a static.
    #[must_use]
    pub const fn new() -> CaptureChannel {
        CaptureChannel {
            queue: Ring::new(),
            shared: Shared {
                tick_ms: AtomicU32::new(0),
                state: AtomicU32::new(0),
                edges_lost: AtomicU32::new(0),
                samples_missed: AtomicU32::new(0),
            },
        }
    }

    /// The interrupt's end and the main loop's end.
    pub fn split(&mut self, debounce: Debounce) -> (Capture<'_>, CaptureReader<'_>) {
        let (writer, reader) = self.queue.split();
        let capture = Capture {
            queue: writer,
            shared: &self.shared,
            debounce,
            inputs: 0,
            tick_ms: 0,
            filter: None,
        };
        (capture, CaptureReader { queue: reader, shared: &self.shared, debounce })
    }
}

impl Default for CaptureChannel {
    fn default() -> Self {
        Self::new()
    }
}

/// Debounce times on their way to the interrupt, made ready so that it is held off for a moment
/// only.
#[derive(Clone, Debug)]
pub struct DebounceTimes {
    filter: Filter,
}

impl DebounceTimes {
    /// Makes these times ready.
    #[must_use]
    pub fn new(debounce: &Debounce) -> DebounceTimes {
        DebounceTimes { filter: Filter::new(debounce, 0) }
    }
}

/// The interrupt's end of the channel.
pub struct Capture<'a> {
    queue: Writer<'a, Sample, QUEUE_LEN>,
    shared: &'a Shared,
    debounce: Debounce,
    /// The latest sample as it was read, and its tick.
    inputs: u32,
    tick_ms: u32,
    /// `None` until the first sample, which is the baseline.
    filter: Option<Filter>,
}

impl Capture<'_> {
    /// Takes the state of all inputs at `tick_ms`, a wrapping count of milliseconds since power-up.
    ///
    /// The count is expected to grow by one. If it grows by more, the samples in between were
    /// missed: they are counted, and the inputs are assumed to have stayed as they were.
    #[inline]
    pub fn sample(&mut self, tick_ms: u32, inputs: u32) {
        match &mut self.filter {
            None => self.begin(tick_ms, inputs),
            Some(_) => {
                let elapsed = tick_ms.wrapping_sub(self.tick_ms);
                if elapsed != 1 && !self.catch_up(tick_ms, elapsed) {
                    return;
                }
                self.step(tick_ms, inputs);
            }
        }
        self.inputs = inputs;
        self.tick_ms = tick_ms;
        // Last: whoever reads this tick finds all changes up to it in the queue.
        self.shared.tick_ms.store(tick_ms, Ordering::Release);
    }

    /// Takes the baseline. Kept apart, because inlined it would cost stack space in every
    /// millisecond.
    #[cold]
    #[inline(never)]
    fn begin(&mut self, tick_ms: u32, inputs: u32) {
        self.filter = Some(Filter::new(&self.debounce, inputs));
        self.push(Sample { tick_ms, changed: 0, state: inputs });
    }

    /// Filters by these debounce times from the next sample on. False when that is not possible
    /// now, and then nothing changes: an input whose time would change is being debounced, or the
    /// queue is full. A board that is told so tries again in the next pass of its main loop.
    ///
    /// The main loop calls this with the capture interrupt held off. It takes as long as a few
    /// samples.
    pub fn take_times(&mut self, times: &DebounceTimes) -> bool {
        let Some(filter) = &mut self.filter else { return false };
        if !self.queue.has_room() || !filter.take_times(&times.filter) {
            return false;
        }
        let state = filter.accepted();
        self.queue.push(Sample { tick_ms: self.tick_ms, changed: 0, state })
    }

    #[inline]
    fn step(&mut self, tick_ms: u32, inputs: u32) {
        let Some(filter) = &mut self.filter else { return };
        let changed = filter.step(inputs);
        if changed != 0 {
            let state = filter.accepted();
            self.push(Sample { tick_ms, changed, state });
        }
    }

    /// Makes up for the samples between the latest one and that of `tick_ms`. False when `tick_ms`
    /// itself calls for no sample.
    ///
    /// Kept apart, so that a sample on time pays for one comparison only.
    #[cold]
    #[inline(never)]
    fn catch_up(&mut self, tick_ms: u32, elapsed: u32) -> bool {
        if elapsed == 0 || elapsed > u32::MAX / 2 {
            // Each millisecond has one sample; a past one gets no further sample.
            return false;
        }
        self.make_up(tick_ms, elapsed - 1);
        true
    }

    /// Runs the filter over missed samples, so that debounce times remain times and do not become
    /// counts of samples.
    fn make_up(&mut self, tick_ms: u32, missed: u32) {
        let count = &self.shared.samples_missed;
        count.store(count.load(Ordering::Relaxed).saturating_add(missed), Ordering::Relaxed);
        if self.filter.as_ref().is_some_and(Filter::is_off) {
            return;
        }
        // After the longest debounce time an unchanging input has nothing left to count.
        let settled = missed.min(u32::from(u8::MAX) + 1);
        let first = tick_ms.wrapping_sub(missed);
        for step in 0..settled {
            self.step(first.wrapping_add(step), self.inputs);
        }
    }

    #[inline]
    fn push(&mut self, sample: Sample) {
        self.shared.state.store(sample.state, Ordering::Relaxed);
        if !self.queue.push(sample) {
            let lost = &self.shared.edges_lost;
            let edges = sample.changed.count_ones();
            lost.store(lost.load(Ordering::Relaxed).saturating_add(edges), Ordering::Relaxed);
        }
    }
}

/// The main loop's end of the channel.
pub struct CaptureReader<'a> {
    queue: Reader<'a, Sample, QUEUE_LEN>,
    shared: &'a Shared,
    debounce: Debounce,
}

impl CaptureReader<'_> {
    /// The tick of the latest sample. All changes up to it can be read.
    #[must_use]
    pub fn tick_ms(&self) -> u32 {
        self.shared.tick_ms.load(Ordering::Acquire)
    }

    /// The inputs that are on as of the latest sample, after debounce.
    #[must_use]
    pub fn state(&self) -> u32 {
        self.shared.state.load(Ordering::Relaxed)
    }

    /// Input changes that found the queue full, since power-up.
    #[must_use]
    pub fn edges_lost(&self) -> u32 {
        self.shared.edges_lost.load(Ordering::Relaxed)
    }

    /// Milliseconds in which no sample was taken because the interrupt came late, since power-up.
    #[must_use]
    pub fn samples_missed(&self) -> u32 {
        self.shared.samples_missed.load(Ordering::Relaxed)
    }

    /// The debounce times at power-up.
    #[must_use]
    pub const fn debounce(&self) -> &Debounce {
        &self.debounce
    }

    /// The next change, if `due` accepts it.
    pub(crate) fn next_if(&mut self, due: impl FnOnce(&Sample) -> bool) -> Option<Sample> {
        if self.queue.peek().as_ref().is_some_and(due) { self.queue.pop() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drain(reader: &mut CaptureReader<'_>) -> Vec<(u32, u32, u32)> {
        std::iter::from_fn(|| reader.next_if(|_| true))
            .map(|sample| (sample.tick_ms, sample.changed, sample.state))
            .collect()
    }

    #[test]
    fn the_first_sample_is_the_baseline_and_changes_follow() {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(Debounce::OFF);
        for (tick_ms, inputs) in [(1, 0b1000), (2, 0b1000), (3, 0b1011), (4, 0b0011)] {
            capture.sample(tick_ms, inputs);
            assert_eq!(reader.tick_ms(), tick_ms);
        }
        assert_eq!(drain(&mut reader), [(1, 0, 0b1000), (3, 0b0011, 0b1011), (4, 0b1000, 0b0011)]);
    }

    #[test]
    fn changes_beyond_the_queue_are_counted_edge_by_edge() {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(Debounce::OFF);
        let toggling = |tick_ms: u32| if tick_ms.is_multiple_of(2) { 0 } else { 0b11 };
        for tick_ms in 0..300 {
            capture.sample(tick_ms, toggling(tick_ms));
        }
        let read = drain(&mut reader);
        assert_eq!(read.len(), QUEUE_LEN);
        assert_eq!(reader.edges_lost(), 2 * (300 - 256));
        // The last change was dropped, but its state is in effect.
        assert_eq!(reader.state(), 0b11);
    }

    #[test]
    fn a_second_sample_in_a_millisecond_is_none() {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(Debounce::OFF);
        capture.sample(1, 0);
        capture.sample(1, 1);
        capture.sample(2, 1);
        assert_eq!(drain(&mut reader), [(1, 0, 0), (2, 1, 1)]);
        assert_eq!(reader.samples_missed(), 0);
    }

    #[test]
    fn a_late_interrupt_is_counted_and_debounce_times_stay_times() {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(Debounce::OFF.with(1, 5));
        capture.sample(10, 0);
        capture.sample(11, 1);
        // Nine samples are missed. Input 1 was seen to change at 11, so its change is accepted as
        // of 16. Input 2 has no debounce: the late sample is the first to see it, and its tick is
        // the stamp.
        capture.sample(21, 0b11);
        capture.sample(22, 0b01);
        assert_eq!(
            drain(&mut reader),
            [(10, 0, 0), (16, 0b01, 0b01), (21, 0b10, 0b11), (22, 0b10, 0b01)]
        );
        assert_eq!(reader.samples_missed(), 9);
    }

    #[test]
    fn a_very_late_interrupt_settles_every_debounce_time() {
        let mut channel = CaptureChannel::new();
        let (mut capture, mut reader) = channel.split(Debounce::uniform(255));
        capture.sample(u32::MAX - 1, 0);
        capture.sample(u32::MAX, 1);
        capture.sample(1_000_000, 0);
        // 255 ms after the change, across the wrap of the tick.
        assert_eq!(drain(&mut reader), [(u32::MAX - 1, 0, 0), (254, 1, 1)]);
    }
}
