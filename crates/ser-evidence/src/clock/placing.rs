//! To which life, and to which run, an observation belongs.

use ser_proto::Entry;

use super::runs::{LifeRuns, Step};
use crate::history::{LifeHistory, RecorderHistory};
use crate::record::{ClockObservation, How, Place, Reference};
use crate::time::{Bound, Moment, Shown, Utc, shown};

/// What a recorder counts modulo.
const WRAP: u64 = 1 << 16;

/// A place in one of a recorder's lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Located {
    /// Index of the life.
    pub(crate) life: usize,
    /// Entries up to this sequence came before.
    pub(crate) after: u64,
    /// Entries above this sequence came after.
    pub(crate) before: u64,
}

/// Where a place is, if that can be said. `then` is what the clock showed.
pub(crate) fn locate(
    history: &RecorderHistory,
    place: &Place,
    then: Option<Moment<Shown>>,
) -> Option<Located> {
    let located = |life: usize, after: u64| {
        let span = match (place.after, place.before) {
            (Some(after), Some(before)) => before.wrapping_sub(after) % WRAP,
            _ => u64::MAX,
        };
        Located { life, after, before: after.saturating_add(span) }
    };
    if place.life.is_known() {
        let is_it = |life: &LifeHistory| life.life == Some(place.life);
        let life = history.lives.iter().position(is_it)?;
        let (after, before) = (place.after.unwrap_or(0), place.before.unwrap_or(u64::MAX));
        return Some(Located { life, after, before });
    }
    let after = place.after?;
    if let Some(newest) = &place.newest {
        let found = history.lives.iter().enumerate().find_map(|(index, life)| {
            same_entry(life, after, newest).map(|sequence| (index, sequence))
        });
        if let Some((life, sequence)) = found {
            return Some(located(life, sequence));
        }
    }
    let may_be = |life: &LifeHistory| !life.is_by_number && !life.entries.is_empty();
    let mut lives = history.lives.iter().enumerate().filter(|(_, life)| may_be(life));
    if after == 0 {
        // The log was empty then. It is the one that began soonest after that.
        let began = |(_, life): &(usize, &LifeHistory)| {
            let first = life.entries.first().filter(|held| held.sequence == 1)?;
            shown(&first.entry.time)
        };
        let begins_later = |life: &(usize, &LifeHistory)| {
            then.is_none_or(|then| began(life).is_some_and(|first| first >= then))
        };
        let (life, _) = lives.filter(begins_later).min_by_key(began)?;
        return Some(located(life, 0));
    }
    // Its newest entry then was not read since. With one life only there is no doubt.
    let (life, only) = lives.next()?;
    let is_exact = only.entries.last().is_some_and(|last| last.sequence < WRAP);
    (lives.next().is_none() && is_exact && place.newest.is_none()).then(|| located(life, after))
}

/// The sequence of this entry in a life, given modulo 65536.
fn same_entry(life: &LifeHistory, sequence: u64, entry: &Entry) -> Option<u64> {
    if life.is_by_number {
        return None;
    }
    let last = life.entries.last()?.sequence;
    let mut candidate = sequence % WRAP;
    while candidate <= last {
        if life.entry(candidate).is_some_and(|held| held.entry == *entry) {
            return Some(candidate);
        }
        candidate += WRAP;
    }
    None
}

/// The run of a located observation, by its index in the life; `None` if it cannot be said.
pub(crate) fn run_of(
    runs: &LifeRuns,
    life: &LifeHistory,
    observation: &ClockObservation,
    index: usize,
    at: Located,
) -> Option<usize> {
    if let Some(step) = runs.steps.iter().position(|step| step.set == Some(index)) {
        return Some(step + 1);
    }
    if observation.how == How::Event {
        let possible = runs.of(at.after);
        return (possible.start() == possible.end()).then_some(*possible.start());
    }
    let sides: Vec<Option<bool>> =
        runs.steps.iter().map(|step| is_after(step, life, observation, at)).collect();
    let first = sides.iter().rposition(|side| *side == Some(true)).map_or(0, |step| step + 1);
    let last = sides.iter().position(|side| *side == Some(false)).unwrap_or(sides.len());
    (first == last).then_some(first)
}

/// Whether an observation was made after a step, if that can be said.
fn is_after(
    step: &Step,
    life: &LifeHistory,
    observation: &ClockObservation,
    at: Located,
) -> Option<bool> {
    if let (Some((boot, step)), Reference::Host { bound, reading }) = (step.at, observation.at)
        && boot == reading.boot
    {
        if step.is_before(bound) {
            return Some(true);
        }
        if bound.is_before(step) {
            return Some(false);
        }
    }
    if step.before < at.after {
        return Some(true);
    }
    if step.after > at.before {
        return Some(false);
    }
    // In the same place. A clock never shows less than the entry before, nor more than the next.
    let stamp = |sequence| life.entry(sequence).and_then(|held| shown(&held.entry.time));
    let fits_before = stamp(step.after).is_none_or(|before| observation.shown >= before);
    let next = step.before.saturating_add(1);
    let fits_after = stamp(next).is_none_or(|after| observation.shown <= after);
    match (fits_before, fits_after) {
        (true, false) => Some(false),
        (false, true) => Some(true),
        _ => None,
    }
}

/// The life and run of an observation by hand, which has no place: the one whose stamps it fits.
pub(crate) fn run_by_stamps(
    history: &RecorderHistory,
    runs: &[LifeRuns],
    seen: Moment<Shown>,
) -> Option<(usize, usize)> {
    let mut found = Vec::new();
    let mut nearest = Vec::new();
    for (index, (life, runs)) in history.lives.iter().zip(runs).enumerate() {
        let mut ends: Vec<Option<(Moment<Shown>, Moment<Shown>)>> = vec![None; runs.count()];
        for held in &life.entries {
            let possible = runs.of(held.sequence);
            let (Some(now), true) = (shown(&held.entry.time), possible.start() == possible.end())
            else {
                continue;
            };
            if let Some(ends) = ends.get_mut(*possible.start()) {
                *ends =
                    Some(ends.map_or((now, now), |(first, last)| (first.min(now), last.max(now))));
            }
        }
        for (run, ends) in ends.iter().enumerate() {
            let Some((first, last)) = ends else { continue };
            if (*first..=*last).contains(&seen) {
                found.push((index, run));
            }
            let distance = first.since(seen).max(seen.since(*last));
            nearest.push((distance, index, run));
        }
    }
    match found.as_slice() {
        [only] => Some(*only),
        // Between two runs it may be of either, unless there is only one.
        [] if nearest.len() == 1 => nearest.first().map(|&(_, life, run)| (life, run)),
        _ => None,
    }
}

/// An observation by hand from the site file, as a bound in UTC.
pub(crate) fn by_hand(host_time: Moment<Utc>, doubt_us: u64) -> Bound<Utc> {
    let doubt = i64::try_from(doubt_us).unwrap_or(i64::MAX / 4);
    Bound::from_us(host_time.us().saturating_sub(doubt), host_time.us().saturating_add(doubt))
}
