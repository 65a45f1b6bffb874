//! The runs of every life of a recorder, by all that is told about its clock being set.

use super::hosts::Hosts;
use super::placing::{self, Located, Whereabouts};
use super::runs::{LifeRuns, Step, When};
use crate::history::{Held, RecorderHistory};
use crate::record::Reference;
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
    for (life, steps) in recorder.lives.iter().zip(steps) {
        let runs = LifeRuns::new(life, steps);
        let ids = (*next_run..*next_run + runs.count()).collect();
        *next_run += runs.count();
        lives.push(LifeClock { runs, ids });
    }
    continue_over_erases(recorder, &mut lives);
    lives
}

/// A step that may be anywhere.
const ANYWHERE: Step =
    Step { after: 0, before: u64::MAX, is_sure: false, at: None, utc: Bound::UNKNOWN, set: None };

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
                let before = lives.get(before)?;
                match before.runs.at_end() {
                    [only] => before.ids.get(*only).copied(),
                    _ => None,
                }
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
