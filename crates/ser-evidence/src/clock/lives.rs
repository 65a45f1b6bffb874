//! The runs of every life of a recorder, by all that is told about its clock being set.

use super::hosts::Hosts;
use super::placing::{self, Located, Whereabouts};
use super::runs::{LifeRuns, Step, When, backward_steps, was_set};
use crate::history::{Held, RecorderHistory};
use crate::record::{How, Reference};
use crate::time::{Bound, Host, Moment, Shown, shown};

/// The runs of one life.
#[derive(Clone, Debug)]
pub(crate) struct LifeClock {
    pub(crate) runs: LifeRuns,
    /// The clock of each run, as an index into [`ClockModel::runs`].
    pub(crate) ids: Vec<usize>,
}

impl LifeClock {
    /// The clock of an entry, if there is no doubt about its run.
    pub(crate) fn sure_run(&self, held: &Held) -> Option<usize> {
        let run = self.runs.of(held.sequence, shown(&held.entry.time)).only()?;
        self.ids.get(run).copied()
    }
}

/// The runs of all lives of a recorder, each with the number of its clock.
pub(super) fn life_clocks(
    recorder: &RecorderHistory,
    hosts: &Hosts,
    next_run: &mut usize,
) -> Vec<LifeClock> {
    let mut steps: Vec<Vec<Step>> = vec![Vec::new(); recorder.lives.len()];
    let is_named = |life: usize| recorder.lives.get(life).is_some_and(|life| life.life.is_some());
    let mut add = |whereabouts: Whereabouts, step: Step| {
        for (index, steps) in steps.iter_mut().enumerate() {
            match whereabouts {
                Whereabouts::Here(Located { life, after, before }) if life == index => {
                    steps.push(Step { after, before, is_sure: true, ..step });
                }
                // A life without a name may be any other one, read at another time.
                Whereabouts::Here(Located { life, .. }) if is_named(life) && is_named(index) => {}
                Whereabouts::Elsewhere if is_named(index) => {}
                _ => steps.push(step),
            }
        }
    };
    for (index, set) in recorder.observations.iter().enumerate() {
        if set.how.is_set() {
            let (at, utc) = when(set.at, hosts);
            let step = Step { at, utc, set: Some((index, set.shown)), ..ANYWHERE };
            add(placing::locate(recorder, &set.place), step);
        }
    }
    for step in &recorder.steps {
        let moment = Bound::new(None, Some(step.reading.monotonic));
        let boot = step.reading.boot;
        let step_then = Step { at: Some((boot, moment)), utc: hosts.utc(boot, moment), ..ANYWHERE };
        add(placing::locate(recorder, &step.place), step_then);
    }
    let mut lives: Vec<LifeClock> = Vec::new();
    for (index, (life, mut steps)) in recorder.lives.iter().zip(steps).enumerate() {
        let secret = secret_steps(recorder, index, &steps, hosts);
        steps.extend(secret);
        let runs = LifeRuns::new(life, steps);
        let ids = (*next_run..*next_run + runs.count()).collect();
        *next_run += runs.count();
        lives.push(LifeClock { runs, ids });
    }
    continue_over_erases(recorder, &mut lives);
    lives
}

/// Steps that nobody told of, and that show between an observation and an entry after it, or before
/// it: the clock showed less than before.
fn secret_steps(
    recorder: &RecorderHistory,
    index: usize,
    told: &[Step],
    hosts: &Hosts,
) -> Vec<Step> {
    let Some(life) = recorder.lives.get(index) else { return Vec::new() };
    let stamp = |held: &Held| Some((held.sequence, shown(&held.entry.time)?));
    let mut steps: Vec<(Step, Moment<Shown>)> = Vec::new();
    for (number, observation) in recorder.observations.iter().enumerate() {
        let Whereabouts::Here(at) = placing::locate(recorder, &observation.place) else { continue };
        let is_event = matches!(observation.how, How::Event | How::Hand);
        if at.life != index || is_event || at.before == u64::MAX {
            continue;
        }
        let seen = observation.shown;
        let (at_host, at_utc) = when(observation.at, hosts);
        let behind = life.entries.partition_point(|held| held.sequence <= at.before);
        let next = life.entries.get(behind..).into_iter().flatten().find_map(stamp);
        if let Some((sequence, now)) = next.filter(|&(_, now)| was_set(seen, now)) {
            let from = |bound: Bound<Host>| Bound::new(bound.lo(), None);
            let step = Step {
                after: at.after,
                before: sequence - 1,
                is_sure: true,
                at: at_host.map(|(boot, bound)| (boot, from(bound))),
                utc: Bound::new(at_utc.lo(), None),
                set: None,
                follows: Some(number),
                is_told: false,
            };
            steps.push((step, now));
        }
        let up_to = life.entries.partition_point(|held| held.sequence <= at.after);
        let last = life.entries.get(..up_to).into_iter().flatten().rev().find_map(stamp);
        // Where entries show it themselves, they say more exactly where it was.
        let is_shown =
            life.entries.get(up_to.saturating_sub(1)..(behind + 1).min(life.entries.len()));
        let is_shown = is_shown.is_some_and(|around| !backward_steps(around).is_empty());
        let last = last.filter(|_| !observation.how.is_set() && !is_shown);
        if let Some((sequence, _)) = last.filter(|&(_, then)| was_set(then, seen)) {
            let until = |bound: Bound<Host>| Bound::new(None, bound.hi());
            let step = Step {
                after: sequence,
                before: at.before,
                is_sure: true,
                at: at_host.map(|(boot, bound)| (boot, until(bound))),
                utc: Bound::new(None, at_utc.hi()),
                set: None,
                follows: None,
                is_told: false,
            };
            steps.push((step, seen));
        }
    }
    // A step that was told may be what shows, unless it was before the observation.
    let is_told = |(secret, shows): &(Step, Moment<Shown>)| {
        told.iter().any(|step| step.explains(secret, *shows) && !step.precedes(secret))
    };
    steps.retain(|secret| !is_told(secret));
    let mut steps: Vec<Step> = steps.into_iter().map(|(step, _)| step).collect();
    // Several observations show one step: the last of those before it says most.
    steps.sort_by_key(|step| {
        let lo = step.at.and_then(|(_, bound)| bound.lo()).map(Moment::us);
        (step.before, lo, step.after, step.follows)
    });
    steps.dedup_by(|later, kept| {
        let is_one =
            later.before == kept.before && later.follows.is_some() == kept.follows.is_some();
        if is_one {
            *kept = *later;
        }
        is_one
    });
    steps
}

/// A step that may be anywhere.
const ANYWHERE: Step = Step {
    after: 0,
    before: u64::MAX,
    is_sure: false,
    at: None,
    utc: Bound::UNKNOWN,
    set: None,
    follows: None,
    is_told: true,
};

/// When something was observed.
pub(super) fn when(at: Reference, hosts: &Hosts) -> When {
    match at {
        Reference::Host { bound, reading } => {
            (Some((reading.boot, bound)), hosts.utc(reading.boot, bound))
        }
        Reference::Utc(bound) => (None, bound),
    }
}

/// An erase by command leaves the clock alone: the first run after it is the last one before.
fn continue_over_erases(recorder: &RecorderHistory, lives: &mut [LifeClock]) {
    // A life of one run may itself continue the one before, so once is not enough.
    for _ in 0..lives.len() {
        for (index, life) in recorder.lives.iter().enumerate() {
            let Some(erased) = life.erased else { continue };
            let before = recorder.lives.iter().position(|other| other.life == Some(erased));
            let last = before.and_then(|before| {
                let (entries, clock) = (&recorder.lives.get(before)?.entries, lives.get(before)?);
                let [last] = *clock.runs.at_end() else { return None };
                // A clock that shows less than before the erase was set by somebody else.
                let stamp = |held: &Held| shown(&held.entry.time);
                let latest = entries.last().and_then(stamp);
                let is_of_last =
                    |held: &Held| clock.runs.of(held.sequence, latest).only() == Some(last);
                let latest = latest.filter(|_| entries.last().is_some_and(is_of_last));
                let first = life.entries.first().and_then(stamp);
                let is_back = latest.zip(first).is_some_and(|(then, now)| was_set(then, now))
                    || first.is_some_and(|now| !clock.runs.may_show(last, now));
                clock.ids.get(last).copied().filter(|_| !is_back)
            });
            let first = lives.get_mut(index).and_then(|life| life.ids.first_mut());
            if let (Some(last), Some(first)) = (last, first)
                && before != Some(index)
            {
                *first = last;
            }
        }
    }
}
