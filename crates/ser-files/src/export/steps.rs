//! From entries to a drawing: the states of all inputs, instant by instant.
//!
//! Entries come in the order of the timeline, and what they say is handed out in strictly rising
//! instants of the axis. An entry also says what was a sample before it, and that matters where
//! nothing was known: so a little of what is to come is held back.
//!
//! - The state of an input is unknown until an entry shows it. It is shown from the sample before
//!   that entry, because a change says what was before it.
//! - After a gap it is unknown from the sample that follows the last entry before the gap.
//! - Entries of one recorder whose times are not known to rise, as after its clock was set back, are
//!   drawn a microsecond apart, in their order.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::io;

use ser_evidence::history::{Held, LogGap};
use ser_evidence::record::Why;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::axis::Axis;
use super::channels::recorder_of;
use super::selection::Selection;

/// How often a recorder looks at its inputs.
pub(super) const SAMPLE_US: i64 = 1000;

/// The states of a recorder's inputs; bit 0 is input 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct States {
    /// Whose state is known.
    pub(super) known: u32,
    /// Which of these are on.
    pub(super) on: u32,
}

impl States {
    /// The inputs that are not as in the other.
    pub(super) const fn differing(self, other: States) -> u32 {
        (self.known ^ other.known) | (self.on ^ other.on)
    }

    /// What is known, and what an entry says of the sample before it where nothing is.
    pub(super) fn revealed_by(self, held: &Held) -> States {
        let shown = held.known.0 & !self.known;
        let was_on = held.entry.state.0 ^ held.entry.changed.0;
        States { known: self.known | shown, on: self.on | was_on & shown }
    }
}

/// Something in the list besides states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Happened {
    /// An entry.
    Entry(EventId),
    /// From here on entries are missing ahead of this one: the gap of this index in its life.
    Loss(EventId, usize),
    /// A clock was set here, or may have been.
    ClockSet(EventId),
}

/// Everything that is at one instant.
#[derive(Debug)]
pub(super) struct Step<'s> {
    /// When, in microseconds of UTC.
    pub(super) at_us: i64,
    /// By recorder: the states before and from now on.
    pub(super) before: &'s [States],
    pub(super) now: &'s [States],
    /// The recorders whose states differ.
    pub(super) changed: &'s [usize],
    /// What happened.
    pub(super) happened: &'s [Happened],
}

/// Hands out every instant of a selection to `take`, in strictly rising order.
///
/// # Errors
/// Those of `take`.
pub(super) fn for_each(
    timeline: &Timeline<'_>,
    selection: &Selection,
    (axis, begins_us): (Axis, i64),
    take: impl FnMut(&Step<'_>) -> io::Result<()>,
) -> io::Result<()> {
    let mut drawing = Drawing::new(timeline, selection, begins_us, take);
    for item in selection.items(timeline) {
        let (Item::Entry(event) | Item::Gap(event, _) | Item::ClockSet(event)) = item;
        // What is missing at the end of a life was drawn after its last entry.
        let Some(at_us) = axis.at(timeline, event) else { continue };
        drawing.draw_until(at_us.saturating_sub(SAMPLE_US))?;
        match item {
            Item::Entry(event) => drawing.entry(event, at_us),
            // Others were drawn after the entry before, or at the beginning.
            Item::Gap(event, index) if event.place == 0 => {
                drawing.add(
                    at_us.saturating_sub(SAMPLE_US),
                    Coming::Happened(Happened::Loss(event, index)),
                );
            }
            Item::Gap(..) => {}
            Item::ClockSet(event) => {
                drawing.add(at_us, Coming::Happened(Happened::ClockSet(event)));
            }
        }
    }
    drawing.draw_until(i64::MAX)
}

/// Something that is to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Coming {
    /// The states that are known from before.
    Begin,
    /// What an entry says of the sample before it, where nothing is known.
    Before(EventId),
    /// These inputs of a recorder are unknown from here on.
    Unknown(u32, u32),
    Happened(Happened),
}

/// Of one recorder, what was drawn last.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// Where its last entry is.
    at_us: i64,
    /// From where on states are unknown, if they are.
    unknown_us: i64,
    /// Whose states are known from then on.
    known: u32,
}

struct Drawing<'t, F> {
    timeline: &'t Timeline<'t>,
    take: F,
    /// Everything before this is drawn.
    floor_us: i64,
    /// What is to come: when, and in which order it was added.
    coming: BinaryHeap<Reverse<(i64, u64, Coming)>>,
    added: u64,
    last: Vec<Last>,
    before: Vec<States>,
    now: Vec<States>,
    changed: Vec<usize>,
    happened: Vec<Happened>,
}

impl<'t, F: FnMut(&Step<'_>) -> io::Result<()>> Drawing<'t, F> {
    fn new(
        timeline: &'t Timeline<'t>,
        selection: &Selection,
        begins_us: i64,
        take: F,
    ) -> Drawing<'t, F> {
        let count = timeline.history().recorders.len();
        let known = selection.begins().map(|begins| states_before(timeline, begins));
        let states = known.unwrap_or_else(|| vec![States::default(); count]);
        let last =
            |states: &States| Last { at_us: i64::MIN, unknown_us: i64::MIN, known: states.known };
        let mut drawing = Drawing {
            timeline,
            take,
            floor_us: begins_us,
            coming: BinaryHeap::new(),
            added: 0,
            last: states.iter().map(last).collect(),
            before: vec![States::default(); count],
            changed: (0..count).filter(|&recorder| is_known(&states, recorder)).collect(),
            now: states,
            happened: Vec::new(),
        };
        // Whatever is known at the beginning, and what is missing from before it.
        for (event, index) in selection.gaps_from_outside(timeline) {
            drawing.add(begins_us, Coming::Happened(Happened::Loss(event, index)));
        }
        if !drawing.changed.is_empty() {
            drawing.add(begins_us, Coming::Begin);
        }
        drawing
    }

    fn add(&mut self, at_us: i64, coming: Coming) {
        self.added += 1;
        let at_us = at_us.max(self.floor_us);
        self.coming.push(Reverse((at_us, self.added, coming)));
    }

    fn entry(&mut self, event: EventId, at_us: i64) {
        let recorder = recorder_of(event);
        let Some(last) = self.last.get(recorder).copied() else { return };
        let at_us = at_us.max(last.at_us.saturating_add(1));
        let known = self.timeline.held(event).map_or(0, |held| held.known.0);
        let before_us = at_us.saturating_sub(SAMPLE_US).max(last.unknown_us).max(last.at_us);
        if before_us < at_us && known & !last.known != 0 {
            self.add(before_us, Coming::Before(event));
        }
        self.add(at_us, Coming::Happened(Happened::Entry(event)));
        let unknown = self.gaps_after(event, at_us);
        let unknown_us = if unknown == 0 { i64::MIN } else { at_us.saturating_add(SAMPLE_US) };
        if let Some(last) = self.last.get_mut(recorder) {
            *last = Last { at_us, unknown_us, known: known & !unknown };
        }
    }

    /// Adds what is missing right after an entry. Returns whose states are unknown from then on.
    fn gaps_after(&mut self, event: EventId, at_us: i64) -> u32 {
        let timeline = self.timeline;
        let Some(life) = timeline.life(event) else { return 0 };
        let after_us = at_us.saturating_add(SAMPLE_US);
        let next = EventId { place: event.place + 1, ..event };
        let place = next.place as usize;
        let mut inputs = 0;
        let first = life.gaps.partition_point(|gap| gap.place < place);
        let gaps = life.gaps.iter().enumerate().skip(first);
        for (index, gap) in gaps.take_while(|(_, gap)| gap.place == place) {
            inputs |= unknown_after(gap);
            self.add(after_us, Coming::Happened(Happened::Loss(next, index)));
        }
        if place == life.entries.len() && ends_in_the_dark(timeline, event) {
            inputs = u32::MAX;
        }
        if inputs != 0 {
            self.add(after_us, Coming::Unknown(event.recorder, inputs));
        }
        inputs
    }

    /// Hands out everything before an instant.
    fn draw_until(&mut self, end_us: i64) -> io::Result<()> {
        while let Some(&Reverse((at_us, _, _))) = self.coming.peek()
            && at_us < end_us
        {
            self.happened.clear();
            while let Some(&Reverse((at, _, coming))) = self.coming.peek()
                && at == at_us
            {
                self.coming.pop();
                self.apply(coming);
            }
            if self.changed.is_empty() && self.happened.is_empty() {
                continue;
            }
            let step = Step {
                at_us,
                before: &self.before,
                now: &self.now,
                changed: &self.changed,
                happened: &self.happened,
            };
            (self.take)(&step)?;
            for recorder in self.changed.drain(..) {
                if let (Some(before), Some(now)) =
                    (self.before.get_mut(recorder), self.now.get(recorder))
                {
                    *before = *now;
                }
            }
        }
        self.floor_us = self.floor_us.max(end_us);
        Ok(())
    }

    fn apply(&mut self, coming: Coming) {
        let (recorder, states) = match coming {
            Coming::Begin => return,
            Coming::Before(event) => {
                let recorder = recorder_of(event);
                let Some((held, now)) = self.timeline.held(event).zip(self.now.get(recorder))
                else {
                    return;
                };
                (recorder, now.revealed_by(held))
            }
            Coming::Unknown(recorder, inputs) => {
                let recorder = recorder as usize;
                let Some(now) = self.now.get(recorder) else { return };
                (recorder, States { known: now.known & !inputs, on: now.on & !inputs })
            }
            Coming::Happened(happened) => {
                self.happened.push(happened);
                let Happened::Entry(event) = happened else { return };
                let Some(held) = self.timeline.held(event) else { return };
                (recorder_of(event), states_of(held))
            }
        };
        let Some(now) = self.now.get_mut(recorder) else { return };
        if *now != states {
            *now = states;
            if !self.changed.contains(&recorder) {
                self.changed.push(recorder);
            }
        }
    }
}

fn is_known(states: &[States], recorder: usize) -> bool {
    states.get(recorder).is_some_and(|states| states.known != 0)
}

/// What is known from an entry on.
fn states_of(held: &Held) -> States {
    let known = held.known.0;
    States { known, on: held.entry.state.0 & known }
}

/// Which inputs may have changed in a gap.
const fn unknown_after(gap: &LogGap) -> u32 {
    match gap.why {
        Why::NotRecorded(inputs) => inputs,
        _ => u32::MAX,
    }
}

/// Whether nothing is known of the states after the last entry of a life: another life came, and
/// not because somebody erased the log.
fn ends_in_the_dark(timeline: &Timeline<'_>, last: EventId) -> bool {
    let (Some(recorder), Some(key)) = (timeline.recorder(last), timeline.sort_key(last)) else {
        return false;
    };
    let name = timeline.life(last).and_then(|life| life.life);
    recorder.lives.iter().zip(0_u32..).any(|(life, index)| {
        let first = EventId { life: index, place: 0, ..last };
        let goes_on = name.is_some() && life.erased == name;
        index != last.life && !goes_on && timeline.sort_key(first).is_some_and(|first| first > key)
    })
}

/// By recorder, what is known of the states right before a place in the list.
pub(super) fn states_before(timeline: &Timeline<'_>, key: i64) -> Vec<States> {
    let recorders = (0_u32..).zip(&timeline.history().recorders);
    let before = |recorder: u32| {
        let event = timeline.last_before(recorder, key)?;
        let (life, held) = (timeline.life(event)?, timeline.held(event)?);
        let next = event.place as usize + 1;
        let mut states = states_of(held);
        for gap in life.gaps.iter().filter(|gap| gap.place == next) {
            states.known &= !unknown_after(gap);
        }
        if next == life.entries.len() && ends_in_the_dark(timeline, event) {
            states.known = 0;
        }
        states.on &= states.known;
        Some(states)
    };
    recorders.map(|(recorder, _)| before(recorder).unwrap_or_default()).collect()
}
