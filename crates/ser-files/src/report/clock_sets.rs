//! When the clocks were set that stamped the rows, in words.

use ser_evidence::record::{ClockObservation, Place, Reference};
use ser_evidence::timeline::{EventId, Timeline};

use super::Clock;

/// A clock that was set between two entries of its recorder.
#[derive(Clone, Debug)]
pub(super) struct ClockSet {
    /// When, in UTC by the clock of the host; `None` if nobody knows.
    pub(super) at_us: Option<i64>,
    pub(super) text: String,
}

/// How the clock was set ahead of an entry. Ahead of the first entry of a log it says nothing,
/// because nothing was stamped by the clock as it was before.
pub(super) fn ahead_of(timeline: &Timeline<'_>, event: EventId, clock: &Clock) -> Option<ClockSet> {
    let sequence = timeline.held(event)?.sequence;
    let before = EventId { place: event.place.checked_sub(1)?, ..event };
    let previous = timeline.held(before)?.sequence;
    let is_between = |place: &Place| {
        timeline.located(event.recorder as usize, place).is_some_and(|(life, after)| {
            life == event.life as usize && (previous..sequence).contains(&after)
        })
    };
    let is_here = |observation: &&ClockObservation| {
        observation.how.is_set() && is_between(&observation.place)
    };
    let observations = timeline.recorder(event)?.observations.iter().filter(is_here);
    let at_us = observations.filter_map(|set| set_at(set.at)).max();
    let is_doubtful = || {
        let mut steps = timeline.recorder(event).into_iter().flat_map(|recorder| &recorder.steps);
        steps.any(|step| is_between(&step.place))
    };
    let text = match at_us {
        Some(at) => format!("the clock was set at {}", dated(timeline, event, at, clock)),
        None => {
            let was = if is_doubtful() { "may have been set" } else { "was set" };
            format!("the clock {was} some time between entries {previous} and {sequence}")
        }
    };
    Some(ClockSet { at_us, text })
}

fn set_at(at: Reference) -> Option<i64> {
    match at {
        Reference::Host { reading, .. } => Some(reading.utc.us()),
        Reference::Utc(bound) => Some(bound.lo()?.us().midpoint(bound.hi()?.us())),
    }
}

/// A time, with its date if that is not the entry's.
fn dated(timeline: &Timeline<'_>, event: EventId, at_us: i64, clock: &Clock) -> String {
    let listed = timeline.time(event).map(|time| clock.date(time.us()));
    match listed.is_some_and(|date| date == clock.date(at_us)) {
        true => clock.time(at_us),
        false => clock.date_and_time(at_us),
    }
}
