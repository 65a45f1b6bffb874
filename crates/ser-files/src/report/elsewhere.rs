//! Rows that are not listed at what their clock showed, though nobody observed that clock.
//!
//! After such a clock was set back, it shows less than before. The order of the log holds, so what
//! came later is listed later, and its own time has to be told beside it.

use std::collections::HashMap;

use ser_evidence::clock::Nominal;
use ser_evidence::incident::Row;
use ser_evidence::time::{Moment, Utc, shown};
use ser_evidence::timeline::{EventId, Timeline};

use super::Clock;

/// How finely clocks show the time, in microseconds.
const STAMP_US: u64 = 1000;

/// Rows of one log in a row that are not listed at what their clock showed, while it ran on.
struct Run {
    first: EventId,
    last: EventId,
}

/// What clocks showed, for entries that are not listed at that: once for each run of them, at its
/// first entry, and what its last one has.
pub(super) fn notes(
    timeline: &Timeline<'_>,
    rows: &[&Row],
    clock: &Clock,
) -> HashMap<EventId, String> {
    let mut runs: Vec<Run> = Vec::new();
    // The run that goes on in each log.
    let mut current: HashMap<(u32, u32), usize> = HashMap::new();
    for event in rows.iter().map(|row| row.change.event) {
        let log = (event.recorder, event.life);
        if !is_elsewhere(timeline, event) {
            current.remove(&log);
            continue;
        }
        let run = current.get(&log).and_then(|&run| runs.get_mut(run));
        match run.filter(|run| shown_at(timeline, run.last) <= shown_at(timeline, event)) {
            Some(run) => run.last = event,
            None => {
                current.insert(log, runs.len());
                runs.push(Run { first: event, last: event });
            }
        }
    }
    let noted = runs.iter().filter_map(|run| Some((run.first, note(timeline, run, clock)?)));
    noted.collect()
}

/// Whether nobody knows when an entry was, except that it was before the next one: its clock was
/// not yet set.
pub(super) fn is_timeless(timeline: &Timeline<'_>, event: EventId) -> bool {
    let is_unbounded = || timeline.moved_on(event, None).values().all(|(lo, _)| lo.is_none());
    timeline.nominal(event) == Nominal::NotKnown && is_unbounded()
}

fn shown_at(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    Some(shown(&timeline.held(event)?.entry.time)?.us())
}

fn note(timeline: &Timeline<'_>, run: &Run, clock: &Clock) -> Option<String> {
    let first = stamp(timeline, run.first, clock)?;
    if run.first == run.last {
        return Some(format!("its clock showed {first}"));
    }
    let last = stamp(timeline, run.last, clock)?;
    let entry = timeline.held(run.last)?.sequence;
    Some(format!("its clock showed {first}, and {last} at entry {entry}"))
}

/// What the clock showed, with the date if that is not the day at which the entry is listed.
fn stamp(timeline: &Timeline<'_>, event: EventId, clock: &Clock) -> Option<String> {
    let stamp = timeline.held(event)?.entry.time.to_string();
    let listed = clock.date(timeline.time(event)?.us());
    Some(match stamp.split_once('T') {
        Some((date, time)) if date == listed => time.to_owned(),
        _ => stamp.replace('T', " "),
    })
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
