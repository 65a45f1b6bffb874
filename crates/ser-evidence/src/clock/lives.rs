//! The runs of every life of a recorder, by all that is told about its clock being set.

use super::hosts::Hosts;
use super::placing::{self, Located, Whereabouts};
use super::runs::{LifeRuns, Step, was_set};
use super::secret_steps::secret_steps;
use super::when::when;
use crate::history::{Held, LifeHistory, RecorderHistory};
use crate::time::{Bound, shown};

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
            let step = Step { at, utc, set: Some((index, set.shown)), ..Step::ANYWHERE };
            add(placing::locate(recorder, &set.place), step);
        }
    }
    for step in &recorder.steps {
        let moment = Bound::new(None, Some(step.reading.monotonic));
        let boot = step.reading.boot;
        let step_then =
            Step { at: Some((boot, moment)), utc: hosts.utc(boot, moment), ..Step::ANYWHERE };
        add(placing::locate(recorder, &step.place), step_then);
    }
    let secret = secret_steps(recorder, &steps, hosts);
    let mut lives: Vec<LifeClock> = Vec::new();
    for (life, (mut steps, secret)) in recorder.lives.iter().zip(steps.into_iter().zip(secret)) {
        steps.extend(secret);
        let runs = LifeRuns::new(life, steps);
        let ids = (*next_run..*next_run + runs.count()).collect();
        *next_run += runs.count();
        lives.push(LifeClock { runs, ids });
    }
    continue_over_erases(recorder, &mut lives);
    lives
}

/// An erase by command leaves the clock alone: the first run after it is the last one before.
fn continue_over_erases(recorder: &RecorderHistory, lives: &mut [LifeClock]) {
    // A life of one run may itself continue the one before, so once is not enough.
    for _ in 0..lives.len() {
        for (index, life) in recorder.lives.iter().enumerate() {
            let before = life.erased.and_then(|erased| {
                recorder.lives.iter().position(|other| other.life == Some(erased))
            });
            let Some(before) = before.filter(|before| *before != index) else { continue };
            let last = clock_that_runs_on(recorder, lives, before, life);
            let first = lives.get_mut(index).and_then(|life| life.ids.first_mut());
            if let (Some(last), Some(first)) = (last, first) {
                *first = last;
            }
        }
    }
}

/// The clock at the end of a life that was erased, if the `next` life may go on with it. A clock that
/// shows less than before the erase was set by somebody else.
fn clock_that_runs_on(
    recorder: &RecorderHistory,
    lives: &[LifeClock],
    before: usize,
    next: &LifeHistory,
) -> Option<usize> {
    let LifeClock { runs, ids } = lives.get(before)?;
    let [last] = *runs.at_end() else { return None };
    let stamp = |held: &Held| Some((held.sequence, shown(&held.entry.time)?));
    if let Some((_, now)) = next.entries.first().and_then(stamp) {
        let latest = recorder.lives.get(before)?.entries.last().and_then(stamp);
        // An entry of another run says nothing of this one.
        let of_last =
            latest.filter(|&(sequence, then)| runs.of(sequence, Some(then)).only() == Some(last));
        let is_back = of_last.is_some_and(|(_, then)| was_set(then, now));
        if is_back || !runs.may_show(last, now) {
            return None;
        }
    }
    ids.get(last).copied()
}
