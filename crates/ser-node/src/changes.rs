//! The changes of the inputs on their way from capture to the log. They come out in order, and only
//! when the clock and mode of their millisecond are known.

use crate::capture::CaptureReader;
use crate::sequencer::{Change, Sequencer};
use crate::ticks::Ticks;

/// The main loop's end of the capture channel, and the sequencer that orders its samples.
pub(crate) struct Changes<'a> {
    capture: CaptureReader<'a>,
    ticks: Ticks,
    sequencer: Sequencer,
    /// The inputs that the recorder has.
    mask: u32,
}

impl<'a> Changes<'a> {
    pub(crate) fn new(capture: CaptureReader<'a>, mask: u32) -> Changes<'a> {
        let sequencer = Sequencer::new(*capture.debounce());
        Changes { capture, ticks: Ticks::new(), sequencer, mask }
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
        let Changes { capture, ticks, sequencer, mask } = self;
        while let Some(sample) = capture.next_if(|sample| ticks.extend(sample.tick_ms) <= until_ms)
        {
            let tick_ms = ticks.extend(sample.tick_ms);
            while let Some(change) = sequencer.next(tick_ms) {
                record(change);
            }
            if sample.changed == 0 {
                sequencer.baseline(sample.state & *mask);
            } else if sample.changed & *mask != 0 {
                sequencer.push(tick_ms, sample.changed & *mask, sample.state & *mask);
            }
        }
        while let Some(change) = sequencer.next(until_ms + 1) {
            record(change);
        }
    }
}
