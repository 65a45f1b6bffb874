//! To which life, and to which run, an observation belongs.

use ser_proto::Entry;

use super::runs::{LifeRuns, Side, Step};
use super::when::{When, is_earlier};
use crate::history::{Held, LifeHistory, RecorderHistory};
use crate::record::{ClockObservation, EntryRecord, Fellow, How, Place};
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

/// Where a place may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Whereabouts {
    /// Here.
    Here(Located),
    /// In a life that no entry is known of.
    Elsewhere,
    /// Nobody can say in which life.
    Anywhere,
}

/// Where a place is.
pub(crate) fn locate(history: &RecorderHistory, place: &Place) -> Whereabouts {
    if place.life.is_known() {
        let is_it = |life: &LifeHistory| life.life == Some(place.life);
        let life = history.lives.iter().position(is_it);
        let (after, before) = (place.after.unwrap_or(0), place.before.unwrap_or(u64::MAX));
        return match life {
            Some(life) => Whereabouts::Here(Located { life, after, before }),
            None => Whereabouts::Elsewhere,
        };
    }
    let Some(after) = place.after else { return Whereabouts::Anywhere };
    let span = place.before.map_or(u64::MAX, |before| before.wrapping_sub(after) % WRAP);
    let here = |life: usize, after: u64| {
        Whereabouts::Here(Located { life, after, before: after.saturating_add(span) })
    };
    if let Some(newest) = &place.newest {
        let found = history.lives.iter().enumerate().find_map(|(index, life)| {
            same_entry(life, after, newest).map(|sequence| (index, sequence))
        });
        if let Some((life, sequence)) = found {
            return here(life, sequence);
        }
    }
    if let Some(Fellow { ahead, entry }) = &place.fellow {
        let total = after.wrapping_add_signed(*ahead);
        let found = history.lives.iter().enumerate().find_map(|(index, life)| {
            let sequence = same_entry(life, total, entry)?;
            Some((index, sequence.checked_add_signed(ahead.checked_neg()?)?))
        });
        return found.map_or(Whereabouts::Anywhere, |(life, after)| here(life, after));
    }
    // That only one life is known does not prove that there was only one.
    Whereabouts::Anywhere
}

/// The sequence of this entry in a life, given modulo 65536.
fn same_entry(life: &LifeHistory, sequence: u64, entry: &Entry) -> Option<u64> {
    if life.is_by_number {
        return None;
    }
    let is_it = |held: &&Held| held.sequence % WRAP == sequence % WRAP && may_be(held, entry);
    let (first, last) = (life.entries.first()?.sequence, life.entries.last()?.sequence);
    let wraps = (last - first) / WRAP + 1;
    // With fewer entries than wraps, it is quicker to look at each of them.
    if wraps > life.entries.len() as u64 {
        return life.entries.iter().find(is_it).map(|held| held.sequence);
    }
    let behind = sequence.wrapping_sub(first) % WRAP;
    let candidates =
        (0..=wraps).filter_map(|wrap| first.checked_add(behind)?.checked_add(wrap * WRAP));
    candidates.filter_map(|candidate| life.entry(candidate)).find(is_it).map(|held| held.sequence)
}

/// Whether an entry that was held may be one of which everything was read.
fn may_be(held: &Held, entry: &Entry) -> bool {
    held.agrees(&Held { entry: *entry, known: EntryRecord::ALL_KNOWN, ..*held })
}

/// The run of a located observation, by its index in the life; `None` if it cannot be said.
pub(crate) fn run_of(
    runs: &LifeRuns,
    life: &LifeHistory,
    (index, observation): (usize, &ClockObservation),
    when: When,
    at: Located,
) -> Option<usize> {
    let is_this = |step: &Step| step.set.is_some_and(|(set, _)| set == index);
    if let Some(step) = runs.steps.iter().position(is_this) {
        return Some(step + 1);
    }
    if observation.how == How::Event {
        return runs.of(at.after, Some(observation.shown)).only();
    }
    let possible = runs.possible(&|_, step| side_of(step, when, at));
    let fits = possible.iter().copied().filter(|&run| runs.may_show(run, observation.shown));
    match fits.collect::<Vec<_>>().as_slice() {
        [only] => Some(*only),
        _ => by_neighbours(runs, life, observation, at),
    }
}

/// On which side of an observation a step was, if that is known.
fn side_of(step: &Step, when: When, at: Located) -> Option<Side> {
    match () {
        () if step.before < at.after || is_earlier(step.when(), when) => Some(Side::Before),
        () if step.after > at.before || is_earlier(when, step.when()) => Some(Side::After),
        () => None,
    }
}

/// Between two entries there is one step, and nothing says on which side of it the observation
/// was. A clock never shows less than at the entry before, nor more than at the next.
fn by_neighbours(
    runs: &LifeRuns,
    life: &LifeHistory,
    observation: &ClockObservation,
    at: Located,
) -> Option<usize> {
    let mut meeting = runs
        .steps
        .iter()
        .enumerate()
        .filter(|(_, step)| step.after <= at.before && step.before >= at.after);
    let (place, step) = meeting.next()?;
    let is_alone = meeting.next().is_none() && step.is_sure;
    let is_here = step.after == step.before && at.after == at.before && step.after == at.after;
    if !is_alone || !is_here {
        return None;
    }
    // A command that somebody sent may have arrived twice, and then there was a time in between.
    let was_sent = step.at.is_some() || step.set.is_some();
    if was_sent && runs.may_show(runs.between_arrivals(place), observation.shown) {
        return None;
    }
    let stamp = |sequence| life.entry(sequence).and_then(|held| shown(&held.entry.time));
    let fits_before = stamp(at.after).is_none_or(|before| observation.shown >= before);
    let fits_after =
        stamp(at.after.saturating_add(1)).is_none_or(|after| observation.shown <= after);
    let run_before = || runs.of(at.after, None).only();
    match (fits_before, fits_after) {
        (true, false) => run_before(),
        (false, true) => Some(place + 1),
        _ => None,
    }
}

/// The life and run of an observation by hand, which has no place: the one whose stamps it fits.
pub(crate) fn run_by_stamps(
    history: &RecorderHistory,
    runs: &[&LifeRuns],
    seen: Moment<Shown>,
) -> Option<(usize, usize)> {
    let mut all = Vec::new();
    for (index, (life, runs)) in history.lives.iter().zip(runs).enumerate() {
        let mut ends: Vec<Option<(Moment<Shown>, Moment<Shown>)>> = vec![None; runs.count()];
        for held in &life.entries {
            let stamp = shown(&held.entry.time);
            let (Some(now), Some(run)) = (stamp, runs.of(held.sequence, stamp).only()) else {
                continue;
            };
            if let Some(ends) = ends.get_mut(run) {
                let (first, last) = ends.unwrap_or((now, now));
                *ends = Some((first.min(now), last.max(now)));
            }
        }
        let known = ends.into_iter().enumerate();
        all.extend(known.filter_map(|(run, ends)| Some((index, run, ends?))));
    }
    let fits = |(_, _, (first, last)): &&(usize, usize, (Moment<Shown>, Moment<Shown>))| {
        (*first..=*last).contains(&seen)
    };
    let found: Vec<_> = all.iter().filter(fits).collect();
    match (found.as_slice(), all.as_slice()) {
        ([(life, run, _)], _) | ([], [(life, run, _)]) => Some((*life, *run)),
        _ => None,
    }
}

/// An observation by hand from the site file, as a bound in UTC.
pub(crate) fn by_hand(host_time: Moment<Utc>, doubt_us: u64) -> Bound<Utc> {
    let doubt = i64::try_from(doubt_us).unwrap_or(i64::MAX / 4);
    Bound::from_us(host_time.us().saturating_sub(doubt), host_time.us().saturating_add(doubt))
}

#[cfg(test)]
mod tests {
    use ser_proto::{Inputs, TimeStamp};

    use super::*;

    #[test]
    fn an_entry_of_which_only_the_changes_are_known_is_found_by_them() {
        let entry = |changed, state| Entry {
            changed: Inputs(changed),
            state: Inputs(state),
            time: TimeStamp {
                year: 26,
                month: 11,
                day: 22,
                hour: 10,
                minute: 0,
                second: 0,
                millisecond: 0,
            },
        };
        let held = Held { sequence: 70_000, entry: entry(1, 1), number: 1, known: Inputs(1) };
        let life = LifeHistory { entries: vec![held], ..LifeHistory::default() };
        let total = 70_000 % WRAP;
        assert_eq!(same_entry(&life, total, &entry(1, 0b101)), Some(70_000));
        assert_eq!(same_entry(&life, total, &entry(1, 0b100)), None, "it went off");
        assert_eq!(same_entry(&life, total, &entry(0b101, 0b101)), None, "another changed too");
    }
}
