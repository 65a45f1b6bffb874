//! The clocks of all recorders in all runs.

use std::collections::BTreeMap;

use super::finding::Finding;
use super::hosts::Hosts;
use super::layout::{Layout, RunFacts, Succession};
use super::links::{self, Link, Links};
use super::lives::{LifeClock, life_clocks};
use super::offsets::RunClock;
use super::sorting::Sorted;
use super::successions::successions;
use crate::history::History;
use crate::record::{HostReading, Reference};
use crate::site::Site;

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
