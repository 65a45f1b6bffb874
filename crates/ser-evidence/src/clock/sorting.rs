//! The observations of each run, and what they make of its clock.

use std::collections::BTreeMap;

use super::finding::Finding;
use super::hosts::Hosts;
use super::links::{Link, LinkReason};
use super::lives::LifeClock;
use super::local::Nominal;
use super::offsets::{Observed, RunClock, boots_of};
use super::placing::{self, Whereabouts};
use super::runs::{LifeRuns, Step};
use super::when::when;
use crate::history::{History, RecorderHistory};
use crate::record::{Boot, ClockObservation, How, Reference};
use crate::site::Site;
use crate::time::{Bound, Moment, Shown, shown};

/// A recorder receives a broadcast in this time, in microseconds: it looks once a millisecond.
const PHASE_US: i64 = 1000;

/// The observations of each run.
#[derive(Debug)]
pub(super) struct Sorted {
    pub(super) by_run: Vec<Vec<Observed>>,
    pub(super) first_stamps: Vec<Option<Moment<Shown>>>,
    pub(super) broadcasts: BTreeMap<u64, Vec<(usize, Moment<Shown>)>>,
    /// What each observation is told by.
    pub(super) told: Vec<i64>,
}

impl Sorted {
    pub(super) fn first_stamps_of(&mut self, recorder: &RecorderHistory, lives: &[LifeClock]) {
        for (life, clock) in recorder.lives.iter().zip(lives) {
            for held in &life.entries {
                let stamp = shown(&held.entry.time);
                for run in clock.runs.of(held.sequence, None).by_place() {
                    let id = clock.ids.get(*run);
                    if let Some(first) = id.and_then(|&id| self.first_stamps.get_mut(id)) {
                        *first = first.or(stamp);
                    }
                }
            }
        }
    }

    /// Gives each observation of a recorder to its runs. Returns those that have none, by what the
    /// clock showed.
    pub(super) fn sort(
        &mut self,
        site: &Site,
        recorder: &RecorderHistory,
        lives: &[LifeClock],
        hosts: &Hosts,
    ) -> Vec<i64> {
        let mut lost = Vec::new();
        for (index, observation) in recorder.observations.iter().enumerate() {
            let runs = runs_of(recorder, lives, hosts, (index, observation));
            if runs.is_empty() {
                lost.push(observation.shown.us());
            }
            self.add_entry_before(recorder, lives, observation);
            for &run in &runs {
                self.add(run, observation.shown, observation.at);
            }
            // A set of which it is not known in which life it was links nobody.
            let sure = sure_run_of(lives, index, observation).or(match runs.as_slice() {
                [only] if !observation.how.is_set() => Some(*only),
                _ => None,
            });
            if let (Some(broadcast), Some(run)) = (observation.how.broadcast(), sure) {
                self.broadcasts.entry(broadcast).or_default().push((run, observation.shown));
            }
        }
        let by_hand = site.observations.iter().filter(|seen| Some(seen.recorder) == recorder.site);
        let runs: Vec<&LifeRuns> = lives.iter().map(|life| &life.runs).collect();
        for seen in by_hand {
            let found = placing::run_by_stamps(recorder, &runs, seen.unit_time);
            let run = found.and_then(|(life, run)| lives.get(life)?.ids.get(run).copied());
            match run {
                Some(run) => {
                    let bound = placing::by_hand(seen.host_time, seen.doubt_us);
                    self.add(run, seen.unit_time, Reference::Utc(bound));
                }
                None => lost.push(seen.unit_time.us()),
            }
        }
        lost
    }

    /// The newest entry in the log had happened when the clock was observed.
    fn add_entry_before(
        &mut self,
        recorder: &RecorderHistory,
        lives: &[LifeClock],
        observation: &ClockObservation,
    ) {
        let Reference::Host { bound, reading } = observation.at else { return };
        let Whereabouts::Here(at) = placing::locate(recorder, &observation.place) else { return };
        if observation.how == How::Event {
            return;
        }
        let life = recorder.lives.get(at.life).zip(lives.get(at.life));
        let found = life.and_then(|(life, clock)| {
            let held = life.entry(at.after)?;
            Some((clock.sure_run(held)?, shown(&held.entry.time)?))
        });
        if let Some((run, stamp)) = found {
            let bound = Bound::new(None, bound.hi());
            self.add(run, stamp, Reference::Host { bound, reading });
        }
    }

    fn add(&mut self, run: usize, shown: Moment<Shown>, at: Reference) {
        let id = self.told.len();
        self.told.push(shown.us());
        if let Some(observed) = self.by_run.get_mut(run) {
            observed.push(Observed { id, shown, at });
        }
    }

    pub(super) fn clocks(
        &self,
        history: &History,
        recorder_of: &[usize],
        hosts: &Hosts,
        findings: &mut Vec<Finding>,
    ) -> Vec<RunClock> {
        let runs_of_boot = self.runs_of_boots();
        let preference = |boot: Boot| runs_of_boot.get(&boot).copied().unwrap_or_default();
        let mut clocks = Vec::new();
        let runs = self.by_run.iter().zip(&self.first_stamps).zip(recorder_of);
        for ((observed, first_stamp), &index) in runs {
            let rates = history.recorders.get(index).map_or((0, 0), |recorder| {
                (recorder.recorder.drift_ppb, recorder.recorder.wander_ppb)
            });
            let (clock, pairs) = RunClock::new(observed, *first_stamp, hosts, rates, &preference);
            for (one, other) in pairs {
                let told = |id: usize| self.told.get(id).copied().unwrap_or_default();
                let mut shown = [told(one), told(other)];
                shown.sort_unstable();
                findings.push(Finding::Contradiction { recorder: index, shown });
            }
            clocks.push(clock);
        }
        findings.sort_unstable();
        findings.dedup();
        clocks
    }

    /// What a stamp of each run is in UTC by what the site says about its clock.
    pub(super) fn nominal(
        &self,
        site: &Site,
        history: &History,
        recorder_of: &[usize],
        runs: &[RunClock],
    ) -> Vec<Option<(i64, i64)>> {
        let each = self.first_stamps.iter().zip(recorder_of).zip(runs);
        each.map(|((stamp, recorder), run)| {
            let rule = history.recorders.get(*recorder)?.recorder.clock;
            let nominal = Nominal::of((*stamp)?, rule, &site.time_zone).earliest()?;
            Some((run.unwrapped((*stamp)?), nominal.us()))
        })
        .collect()
    }

    /// How many runs each boot has observed.
    fn runs_of_boots(&self) -> BTreeMap<Boot, usize> {
        let mut counts = BTreeMap::new();
        for observed in &self.by_run {
            for boot in boots_of(observed) {
                *counts.entry(boot).or_default() += 1;
            }
        }
        counts
    }

    /// All recorders that received a broadcast received it at one instant, and saw it within a
    /// millisecond.
    pub(super) fn broadcast_links(&self, runs: &[RunClock]) -> Vec<Link> {
        let mut links = Vec::new();
        for (&broadcast, heard) in &self.broadcasts {
            for (place, &(one, shown)) in heard.iter().enumerate() {
                for &(other, other_shown) in heard.iter().skip(place + 1) {
                    let (Some(clock), Some(other_clock)) = (runs.get(one), runs.get(other)) else {
                        continue;
                    };
                    if one == other {
                        continue;
                    }
                    let (x, other_x) = (clock.unwrapped(shown), other_clock.unwrapped(other_shown));
                    let why = LinkReason::Broadcast(broadcast);
                    let link = Link { one, other, x, other_x, lo: -PHASE_US, hi: PHASE_US, why };
                    links.push(link);
                }
            }
        }
        links
    }
}

/// The clock of the run that a set begins, if it is known in which life it was.
fn sure_run_of(lives: &[LifeClock], index: usize, observation: &ClockObservation) -> Option<usize> {
    let is_this = |step: &Step| step.is_sure && step.set.is_some_and(|(set, _)| set == index);
    let mut runs = lives.iter().filter(|_| observation.how.is_set()).filter_map(|life| {
        let step = life.runs.steps.iter().position(is_this)?;
        life.ids.get(step + 1).copied()
    });
    runs.next()
}

/// The clocks of the runs that an observation tells of: of one, or, for a set that may be in any of
/// several lives, of the run that it begins in each. The run between two arrivals of a set is one
/// more.
pub(crate) fn runs_of(
    recorder: &RecorderHistory,
    lives: &[LifeClock],
    hosts: &Hosts,
    (index, observation): (usize, &ClockObservation),
) -> Vec<usize> {
    let mut found = Vec::new();
    for life in lives {
        let is_this = |step: &Step| step.set.is_some_and(|(set, _)| set == index);
        if let Some(step) = life.runs.steps.iter().position(is_this) {
            let runs = [step + 1, life.runs.between_arrivals(step)];
            found.extend(runs.iter().filter_map(|&run| life.ids.get(run).copied()));
        }
    }
    if observation.how.is_set() {
        return found;
    }
    let run = match placing::locate(recorder, &observation.place) {
        Whereabouts::Here(at) => {
            lives.get(at.life).zip(recorder.lives.get(at.life)).and_then(|(clock, life)| {
                let when = when(observation.at, hosts);
                let run = placing::run_of(&clock.runs, life, (index, observation), when, at)?;
                clock.ids.get(run).copied()
            })
        }
        Whereabouts::Anywhere if observation.how == How::Hand => {
            let runs: Vec<&LifeRuns> = lives.iter().map(|life| &life.runs).collect();
            placing::run_by_stamps(recorder, &runs, observation.shown)
                .and_then(|(life, run)| lives.get(life)?.ids.get(run).copied())
        }
        Whereabouts::Anywhere | Whereabouts::Elsewhere => None,
    };
    found.extend(run);
    found
}
