//! The clocks of all recorders in all runs.

use std::collections::BTreeMap;

use super::hosts::Hosts;
use super::layout::{Layout, RunFacts, Succession};
use super::links::{self, Link, LinkReason, Links};
use super::local::Nominal;
use super::offsets::{Observed, RunClock};
use super::placing::{self, Located, Whereabouts};
use super::runs::{LifeRuns, Step, When};
use crate::history::{Held, History, RecorderHistory};
use crate::record::{Boot, ClockObservation, HostReading, How, Reference};
use crate::site::Site;
use crate::time::{Bound, Moment, Shown, shown};

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
    pub(crate) layout: Layout,
    untightened: Vec<RunClock>,
    sorted: Sorted,
    successions: Vec<Succession>,
    nominal: Vec<Option<(i64, i64)>>,
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
    /// The clock of an entry, if there is no doubt about its run.
    pub(crate) fn sure_run(&self, held: &Held) -> Option<usize> {
        let run = self.runs.of(held.sequence, shown(&held.entry.time)).only()?;
        self.ids.get(run).copied()
    }
}

/// The observations of each run.
#[derive(Debug)]
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
        let lives: Vec<Vec<LifeClock>> = history
            .recorders
            .iter()
            .map(|recorder| life_clocks(recorder, &hosts, &mut next_run))
            .collect();
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
            let lost = sorted.sort(site, recorder, lives, &hosts);
            findings.extend(
                lost.into_iter().map(|shown| Finding::NotPlaced { recorder: index, shown }),
            );
        }
        let runs = sorted.clocks(history, &recorder_of, &hosts, &mut findings);
        let links = sorted.broadcast_links(&runs);
        let untightened = runs.clone();
        let successions = successions(history, &lives, &runs);
        let nominal = sorted.nominal(site, history, &recorder_of, &runs);
        let mut model = ClockModel {
            hosts,
            runs,
            lives,
            recorder_of,
            links,
            by_pair: Links::default(),
            layout: Layout::default(),
            untightened,
            sorted,
            successions,
            nominal,
            findings,
        };
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
        self.by_pair = Links::new(&self.links, &self.runs);
        let sorted = &self.sorted;
        let facts = self.runs.iter().zip(&sorted.by_run).zip(&sorted.first_stamps);
        let facts: Vec<RunFacts<'_>> = facts
            .zip(&self.nominal)
            .map(|(((clock, observed), stamp), nominal)| RunFacts {
                clock,
                observed,
                nominal: *nominal,
                stamp: stamp.map(|stamp| clock.unwrapped(stamp)),
            })
            .collect();
        self.layout = Layout::new(&self.hosts, &facts, &self.links, &self.successions);
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
fn life_clocks(recorder: &RecorderHistory, hosts: &Hosts, next_run: &mut usize) -> Vec<LifeClock> {
    let mut steps: Vec<Vec<Step>> = vec![Vec::new(); recorder.lives.len()];
    let mut add = |whereabouts: Whereabouts, step: Step| {
        for (index, (life, steps)) in recorder.lives.iter().zip(&mut steps).enumerate() {
            match whereabouts {
                Whereabouts::Here(Located { life, after, before }) if life == index => {
                    steps.push(Step { after, before, is_sure: true, ..step });
                }
                // A life without a name may be the same one, read at another time.
                Whereabouts::Here(_) | Whereabouts::Elsewhere if life.life.is_some() => {}
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

/// Which run of a life comes right before which, by entries whose runs are sure.
fn successions(history: &History, lives: &[Vec<LifeClock>], runs: &[RunClock]) -> Vec<Succession> {
    let mut successions = Successions::default();
    for (recorder, clocks) in history.recorders.iter().zip(lives) {
        for (life, clock) in recorder.lives.iter().zip(clocks) {
            successions.begin_life();
            for held in &life.entries {
                let Some(stamp) = shown(&held.entry.time) else { continue };
                let possible = clock.runs.of(held.sequence, Some(stamp)).runs();
                let ids = possible.filter_map(|run| clock.ids.get(run).copied());
                let x = |run: usize| runs.get(run).map(|clock| (run, clock.unwrapped(stamp)));
                successions.add(ids.filter_map(x).collect());
            }
        }
    }
    successions.all
}

/// What an entry may be: the runs in which it may be, and what the clock showed in each.
type Possible = Vec<(usize, i64)>;

/// Finds what the order of the entries of a life says that their stamps do not.
#[derive(Debug, Default)]
struct Successions {
    all: Vec<Succession>,
    /// The last entry whose run is sure.
    sure: Option<(usize, i64)>,
    /// After that: the last entry of each stretch of entries that may be in the same runs.
    doubtful: Vec<Possible>,
}

impl Successions {
    fn begin_life(&mut self) {
        self.sure = None;
        self.doubtful.clear();
    }

    fn add(&mut self, possible: Possible) {
        match possible.as_slice() {
            [] => {}
            [only] => self.add_sure(*only),
            _ => self.add_doubtful(possible),
        }
    }

    fn add_sure(&mut self, next: (usize, i64)) {
        if let Some(sure) = self.sure.filter(|(run, _)| *run != next.0) {
            self.all.push(Succession { earlier: vec![sure], later: vec![next] });
        }
        for earlier in self.doubtful.drain(..) {
            self.all.push(Succession { earlier, later: vec![next] });
        }
        self.sure = Some(next);
    }

    fn add_doubtful(&mut self, possible: Possible) {
        let runs = |possible: &Possible| possible.iter().map(|(run, _)| *run).collect::<Vec<_>>();
        match self.doubtful.last_mut() {
            Some(last) if runs(last) == runs(&possible) => *last = possible,
            _ => {
                if let Some(sure) = self.sure {
                    let (earlier, later) = (vec![sure], possible.clone());
                    self.all.push(Succession { earlier, later });
                }
                self.doubtful.push(possible);
            }
        }
    }
}

/// A step that may be anywhere.
const ANYWHERE: Step =
    Step { after: 0, before: u64::MAX, is_sure: false, at: None, utc: Bound::UNKNOWN, set: None };

/// When something was observed.
fn when(at: Reference, hosts: &Hosts) -> When {
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

impl Sorted {
    fn first_stamps_of(&mut self, recorder: &RecorderHistory, lives: &[LifeClock]) {
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
    fn sort(
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

    /// What a stamp of each run is in UTC by what the site says about its clock.
    fn nominal(
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
fn runs_of(
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
