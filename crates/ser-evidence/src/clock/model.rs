//! The clocks of all recorders in all runs.

use std::collections::BTreeMap;

use super::hosts::Hosts;
use super::links::{self, Link, LinkReason, Links};
use super::offsets::{Observed, RunClock};
use super::placing::{self, Located};
use super::runs::{LifeRuns, Step};
use crate::history::{History, RecorderHistory};
use crate::record::{Boot, ClockObservation, HostReading, Reference};
use crate::site::Site;
use crate::time::{Moment, Shown, shown};

/// A recorder receives a broadcast in this time, in microseconds: it looks once a millisecond.
const PHASE_US: i64 = 1000;

/// Something about clocks that people should know.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Finding {
    /// Two observations of one run cannot both be true. What either of them allows is used.
    Contradiction {
        /// The recorder, by its index in the history.
        recorder: usize,
        /// What the clock showed at either.
        shown: [i64; 2],
    },
    /// It cannot be said to which run of the clock an observation belongs, so it is not used.
    NotPlaced {
        /// The recorder, by its index in the history.
        recorder: usize,
        /// What the clock showed.
        shown: i64,
    },
    /// A link between two recorders contradicts what is known otherwise, so it is not used.
    WrongLink {
        /// The recorders, by their indices in the history.
        recorders: [usize; 2],
        /// What linked them.
        why: LinkReason,
    },
    /// The clock of an observing host was set meanwhile. What either of its readings allows is
    /// used.
    HostStepped(Boot),
}

/// The clocks of all recorders.
#[derive(Debug)]
pub(crate) struct ClockModel {
    pub(crate) hosts: Hosts,
    pub(crate) runs: Vec<RunClock>,
    /// By recorder and life.
    pub(crate) lives: Vec<Vec<LifeClock>>,
    /// To which recorder each run belongs.
    pub(crate) recorder_of: Vec<usize>,
    links: Vec<Link>,
    pub(crate) by_pair: Links,
    untightened: Vec<RunClock>,
    pub(crate) findings: Vec<Finding>,
}

/// The runs of one life.
#[derive(Clone, Debug)]
pub(crate) struct LifeClock {
    pub(crate) runs: LifeRuns,
    /// The clock of each run, as an index into [`ClockModel::runs`].
    pub(crate) ids: Vec<usize>,
}

impl LifeClock {
    /// The clock of the entry of this sequence, if there is no doubt about its run.
    pub(crate) fn sure_run(&self, sequence: u64) -> Option<usize> {
        let possible = self.runs.of(sequence);
        let first = self.ids.get(*possible.start())?;
        (possible.start() == possible.end()).then_some(*first)
    }
}

/// The observations of each run.
struct Sorted {
    by_run: Vec<Vec<Observed>>,
    first_stamps: Vec<Option<Moment<Shown>>>,
    broadcasts: BTreeMap<u64, Vec<(usize, Moment<Shown>)>>,
    /// What each observation is told by.
    told: Vec<i64>,
}

impl ClockModel {
    pub(crate) fn new(site: &Site, history: &History) -> ClockModel {
        let mut findings = Vec::new();
        let (hosts, stepped) = Hosts::new(readings(history), site.utc_doubt_us);
        findings.extend(stepped.into_iter().map(Finding::HostStepped));
        let mut next_run = 0;
        let lives: Vec<Vec<LifeClock>> =
            history.recorders.iter().map(|recorder| life_clocks(recorder, &mut next_run)).collect();
        let mut sorted = Sorted {
            by_run: vec![Vec::new(); next_run],
            first_stamps: vec![None; next_run],
            broadcasts: BTreeMap::new(),
            told: Vec::new(),
        };
        let mut recorder_of = vec![0; next_run];
        for (index, (recorder, lives)) in history.recorders.iter().zip(&lives).enumerate() {
            for run in lives.iter().flat_map(|life| &life.ids) {
                if let Some(of) = recorder_of.get_mut(*run) {
                    *of = index;
                }
            }
            sorted.first_stamps_of(recorder, lives);
            let lost = sorted.sort(site, recorder, lives);
            findings.extend(
                lost.into_iter().map(|shown| Finding::NotPlaced { recorder: index, shown }),
            );
        }
        let runs = sorted.clocks(history, &recorder_of, &hosts, &mut findings);
        let links = sorted.broadcast_links(&runs);
        let untightened = runs.clone();
        let by_pair = Links::default();
        let mut model =
            ClockModel { hosts, runs, lives, recorder_of, links, by_pair, untightened, findings };
        model.tighten();
        model
    }

    /// Adds what contacts that are wired to two recorders say, and lets the clocks bound each other
    /// anew.
    pub(crate) fn add_links(&mut self, links: Vec<Link>) {
        self.links.extend(links);
        self.runs.clone_from(&self.untightened);
        self.tighten();
    }

    fn tighten(&mut self) {
        let wrong = links::tighten(&mut self.runs, &mut self.links);
        for link in wrong {
            let recorder = |run: usize| self.recorder_of.get(run).copied().unwrap_or_default();
            let recorders = [recorder(link.one), recorder(link.other)];
            let finding = Finding::WrongLink { recorders, why: link.why };
            if !self.findings.contains(&finding) {
                self.findings.push(finding);
            }
        }
        self.by_pair = Links::new(&self.links);
    }
}

/// Every reading of a host's clocks.
fn readings(history: &History) -> Vec<HostReading> {
    let mut readings = Vec::new();
    for recorder in &history.recorders {
        readings.extend(recorder.observations.iter().filter_map(
            |observation| match observation.at {
                Reference::Host { reading, .. } => Some(reading),
                Reference::Utc(_) => None,
            },
        ));
        readings.extend(recorder.steps.iter().map(|step| step.reading));
        readings.extend(recorder.watched.iter().flat_map(|watched| [watched.from, watched.to]));
    }
    readings
}

/// The runs of all lives of a recorder, each with the number of its clock.
fn life_clocks(recorder: &RecorderHistory, next_run: &mut usize) -> Vec<LifeClock> {
    let mut steps: Vec<Vec<Step>> = vec![Vec::new(); recorder.lives.len()];
    let mut add = |at: Located, step: Step| {
        if let Some(steps) = steps.get_mut(at.life) {
            steps.push(step);
        }
    };
    for (index, set) in recorder.observations.iter().enumerate() {
        if !set.how.is_set() {
            continue;
        }
        if let Some(at) = placing::locate(recorder, &set.place, Some(set.shown)) {
            add(at, Step::of_set(set, index, at));
        }
    }
    for step in &recorder.steps {
        if let Some(at) = placing::locate(recorder, &step.place, None) {
            add(at, Step::unconfirmed(step, at));
        }
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

/// An erase by command leaves the clock alone: the first run after it is the last one before.
fn continue_over_erases(recorder: &RecorderHistory, lives: &mut [LifeClock]) {
    // A life of one run may itself continue the one before, so once is not enough.
    for _ in 0..lives.len() {
        for (index, life) in recorder.lives.iter().enumerate() {
            let Some(erased) = life.erased else { continue };
            let before = recorder.lives.iter().position(|other| other.life == Some(erased));
            let last = before.and_then(|before| lives.get(before)?.ids.last().copied());
            let first = lives.get_mut(index).and_then(|life| life.ids.first_mut());
            if let (Some(last), Some(first)) = (last, first)
                && before != Some(index)
            {
                *first = last;
            }
        }
    }
}

impl Sorted {
    fn first_stamps_of(&mut self, recorder: &RecorderHistory, lives: &[LifeClock]) {
        for (life, clock) in recorder.lives.iter().zip(lives) {
            for (run, id) in clock.ids.iter().enumerate() {
                let begins = match run.checked_sub(1).and_then(|step| clock.runs.steps.get(step)) {
                    Some(step) => life.place_of(step.before.saturating_add(1)),
                    None => 0,
                };
                let mut entries = life.entries.iter().skip(begins);
                let stamp = entries.find_map(|held| shown(&held.entry.time));
                if let Some(first) = self.first_stamps.get_mut(*id) {
                    *first = first.or(stamp);
                }
            }
        }
    }

    /// Gives each observation of a recorder to its run. Returns those that have none, by what the
    /// clock showed.
    fn sort(&mut self, site: &Site, recorder: &RecorderHistory, lives: &[LifeClock]) -> Vec<i64> {
        let mut lost = Vec::new();
        for (index, observation) in recorder.observations.iter().enumerate() {
            match run_of(recorder, lives, observation, index) {
                Some(run) => {
                    self.add(run, observation.shown, observation.at);
                    if let Some(broadcast) = observation.how.broadcast() {
                        let heard = self.broadcasts.entry(broadcast).or_default();
                        heard.push((run, observation.shown));
                    }
                }
                None => lost.push(observation.shown.us()),
            }
        }
        let by_hand = site.observations.iter().filter(|seen| Some(seen.recorder) == recorder.site);
        for seen in by_hand {
            let runs: Vec<LifeRuns> = lives.iter().map(|life| life.runs.clone()).collect();
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

    fn add(&mut self, run: usize, shown: Moment<Shown>, at: Reference) {
        let id = self.told.len();
        self.told.push(shown.us());
        if let Some(observed) = self.by_run.get_mut(run) {
            observed.push(Observed { id, shown, at });
        }
    }

    fn clocks(
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

    /// How many runs each boot has observed.
    fn runs_of_boots(&self) -> BTreeMap<Boot, usize> {
        let mut counts = BTreeMap::new();
        for observed in &self.by_run {
            let mut boots: Vec<Boot> = observed
                .iter()
                .filter_map(|observed| match observed.at {
                    Reference::Host { reading, .. } => Some(reading.boot),
                    Reference::Utc(_) => None,
                })
                .collect();
            boots.sort_unstable();
            boots.dedup();
            for boot in boots {
                *counts.entry(boot).or_default() += 1;
            }
        }
        counts
    }

    /// All recorders that received a broadcast received it at one instant, and saw it within a
    /// millisecond.
    fn broadcast_links(&self, runs: &[RunClock]) -> Vec<Link> {
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

/// The clock of the run to which an observation belongs.
fn run_of(
    recorder: &RecorderHistory,
    lives: &[LifeClock],
    observation: &ClockObservation,
    index: usize,
) -> Option<usize> {
    let located = placing::locate(recorder, &observation.place, Some(observation.shown));
    if let Some(at) = located {
        let clock = lives.get(at.life)?;
        let life = recorder.lives.get(at.life)?;
        let run = placing::run_of(&clock.runs, life, observation, index, at)?;
        return clock.ids.get(run).copied();
    }
    if observation.how.is_set() {
        return None;
    }
    let runs: Vec<LifeRuns> = lives.iter().map(|life| life.runs.clone()).collect();
    let (life, run) = placing::run_by_stamps(recorder, &runs, observation.shown)?;
    lives.get(life)?.ids.get(run).copied()
}
