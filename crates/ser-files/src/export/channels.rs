//! Which inputs are drawn: those with a name in the site file, and those that moved.

use ser_evidence::site::{Point, PointId};
use ser_evidence::timeline::{EventId, Timeline};

use crate::names::{self, harmless};

/// The inputs of a recorder.
const INPUTS: u8 = 32;

/// One input that is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    /// The recorder's index in the history.
    pub(super) recorder: usize,
    /// The input, from 1.
    pub(super) input: u8,
    /// Its point, if it has a name.
    pub(super) point: Option<PointId>,
}

/// All inputs that are drawn, by recorder and input.
#[derive(Clone, Debug)]
pub(super) struct Channels {
    all: Vec<Channel>,
    /// By recorder: where its first one is in the list, and which inputs are in it.
    recorders: Vec<(usize, u32)>,
}

impl Channels {
    /// Those that are named, and those in these sets of each recorder.
    pub(super) fn new(timeline: &Timeline<'_>, moved: &[u32]) -> Channels {
        let site = timeline.site();
        let (mut all, mut recorders) = (Vec::new(), Vec::new());
        for (recorder, history) in timeline.history().recorders.iter().enumerate() {
            let first = all.len();
            let mut inputs = 0;
            for input in 1..=INPUTS {
                let point = history.site.and_then(|id| site.point_at(id, input));
                let has_moved = moved.get(recorder).is_some_and(|moved| moved & bit(input) != 0);
                if point.is_some() || has_moved {
                    inputs |= bit(input);
                    all.push(Channel { recorder, input, point });
                }
            }
            recorders.push((first, inputs));
        }
        Channels { all, recorders }
    }

    pub(super) fn all(&self) -> &[Channel] {
        &self.all
    }

    /// Those of a recorder.
    pub(super) fn of(&self, recorder: usize) -> &[Channel] {
        let (first, inputs) = self.recorders.get(recorder).copied().unwrap_or((0, 0));
        let end = first + usize::try_from(inputs.count_ones()).unwrap_or(0);
        self.all.get(first..end).unwrap_or(&[])
    }

    /// The inputs of a recorder that are drawn.
    pub(super) fn inputs_of(&self, recorder: usize) -> u32 {
        self.recorders.get(recorder).map_or(0, |&(_, inputs)| inputs)
    }

    /// Where the input with this bit is in the list; it must be one of those that are drawn.
    pub(super) fn place_of(&self, recorder: usize, bit: u32) -> usize {
        let (first, inputs) = self.recorders.get(recorder).copied().unwrap_or((0, 0));
        let before = (inputs & (bit - 1)).count_ones();
        first + usize::try_from(before).unwrap_or(0)
    }

    /// Whether several recorders have one.
    pub(super) fn are_of_several(&self) -> bool {
        self.recorders.iter().filter(|(_, inputs)| *inputs != 0).count() > 1
    }
}

impl Channel {
    /// The point, if it has a name.
    pub(super) fn named<'t>(&self, timeline: &Timeline<'t>) -> Option<&'t Point> {
        self.point.and_then(|id| names::point_of(timeline, id))
    }

    /// Its name in its recorder.
    pub(super) fn name(&self, timeline: &Timeline<'_>) -> String {
        names::point(timeline, self.point, self.input)
    }
}

/// The name of a recorder.
pub(super) fn recorder_name(timeline: &Timeline<'_>, recorder: usize) -> String {
    let found = timeline.history().recorders.get(recorder);
    found.map_or_else(String::new, |found| harmless(&found.recorder.name))
}

/// The index of an event's recorder.
pub(super) const fn recorder_of(event: EventId) -> usize {
    event.recorder as usize
}

const fn bit(input: u8) -> u32 {
    1 << (input - 1)
}

/// The lowest bit of a set, and the rest.
pub(super) const fn split_lowest(bits: u32) -> (u32, u32) {
    (bits & bits.wrapping_neg(), bits & bits.wrapping_sub(1))
}
