//! What has to be known of a selection before its first row is written.

use ser_evidence::timeline::{Item, Timeline};

use super::axis::Axis;
use super::channels::Channels;
use super::counted::Counted;
use super::selection::Selection;
use super::steps::{SAMPLE_US, States, states_before};

/// A selection, and the axis on which it is drawn.
#[derive(Debug)]
pub(super) struct Survey {
    pub(super) axis: Axis,
    pub(super) channels: Channels,
    /// Where the earliest and the latest entry are on the axis; `None` if none has a time.
    pub(super) span: Option<Span>,
    pub(super) counted: Counted,
    /// By recorder: how many entries, also without a time, and whether something is missing.
    pub(super) recorders: Vec<(u64, bool)>,
    /// By recorder: the inputs that are on before the first entry, as far as entries say it.
    pub(super) first_on: Vec<u32>,
}

/// Where the drawing begins and ends, in microseconds of UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) first_us: i64,
    pub(super) last_us: i64,
}

impl Span {
    /// This one, made so wide that it holds an entry as well.
    fn with(span: Option<Span>, at_us: i64) -> Span {
        let Span { first_us, last_us } = span.unwrap_or(Span { first_us: at_us, last_us: at_us });
        Span { first_us: first_us.min(at_us), last_us: last_us.max(at_us) }
    }

    /// Where the axis begins: with the sample before the first entry.
    pub(super) const fn begins_us(self) -> i64 {
        self.first_us.saturating_sub(SAMPLE_US)
    }
}

impl Survey {
    pub(super) fn of(timeline: &Timeline<'_>, selection: &Selection) -> Survey {
        let axis = Axis::of(timeline);
        let count = timeline.history().recorders.len();
        let mut moved = vec![0; count];
        let begins = selection.begins();
        let mut first = begins.map_or_else(
            || vec![States::default(); count],
            |begins| states_before(timeline, begins),
        );
        let mut recorders = vec![(0, false); count];
        let mut counted = Counted::default();
        let mut span: Option<Span> = None;
        for item in selection.items(timeline) {
            let event = match item {
                Item::Entry(event) => event,
                Item::Gap(event, _) => {
                    counted.losses += 1;
                    if let Some((_, is_broken)) = recorders.get_mut(event.recorder as usize) {
                        *is_broken = true;
                    }
                    continue;
                }
                Item::ClockSet(_) => continue,
            };
            let recorder = event.recorder as usize;
            if let Some((entries, _)) = recorders.get_mut(recorder) {
                *entries += 1;
            }
            let Some(at_us) = axis.at(timeline, event) else {
                counted.timeless += 1;
                continue;
            };
            counted.entries += 1;
            let of_recorder = (moved.get_mut(recorder), first.get_mut(recorder));
            if let ((Some(moved), Some(first)), Some(held)) = (of_recorder, timeline.held(event)) {
                *moved |= held.entry.changed.0;
                *first = first.revealed_by(held);
            }
            span = Some(Span::with(span, at_us));
        }
        let first_on = first.iter().map(|states| states.on).collect();
        Survey {
            axis,
            channels: Channels::new(timeline, &moved),
            span,
            counted,
            recorders,
            first_on,
        }
    }
}

/// When the drawing of a selection begins, in microseconds of UTC; `None` if no entry has a time.
#[must_use]
pub fn begins_us(timeline: &Timeline<'_>, selection: &Selection) -> Option<i64> {
    Some(Survey::of(timeline, selection).span?.begins_us())
}
