//! Rows that are not listed at what their clock showed, though nobody observed that clock.
//!
//! After such a clock was set back, it shows less than before. The order of the log holds, so what
//! came later is listed later, and its own time has to be told beside it.

use ser_evidence::clock::Nominal;
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::{EventId, Timeline};

use super::Clock;

/// How finely clocks show the time, in microseconds.
const STAMP_US: u64 = 1000;

/// What the clock showed, for a row that is not listed at that.
pub(super) fn note(timeline: &Timeline<'_>, event: EventId, clock: &Clock) -> Option<String> {
    let stamp = timeline.held(event)?.entry.time.to_string();
    if !is_elsewhere(timeline, event) {
        return None;
    }
    let listed = clock.date(timeline.time(event)?.us());
    let stamp = match stamp.split_once('T') {
        Some((date, time)) if date == listed => time.to_owned(),
        _ => stamp.replace('T', " "),
    };
    Some(format!("its clock showed {stamp}"))
}

/// Whether an entry is not listed at what its clock showed, and nobody observed that clock.
pub(super) fn is_elsewhere(timeline: &Timeline<'_>, event: EventId) -> bool {
    let Some(listed) = timeline.time(event) else { return false };
    let bounds = timeline.moved_on(event, None);
    if bounds.values().any(|(lo, hi)| lo.is_some() || hi.is_some()) {
        return false;
    }
    let listed = listed.us().saturating_sub(timeline.shift_us(event));
    let is_at = |shown: Moment<Utc>| listed.abs_diff(shown.us()) <= STAMP_US;
    match timeline.nominal(event) {
        Nominal::Time(shown) | Nominal::Missing(shown) => !is_at(shown),
        Nominal::Ambiguous(early, late) => !is_at(early) && !is_at(late),
        Nominal::NotKnown => true,
    }
}
