//! What is forwarded to a server of `PostgreSQL` that is stopped and killed meanwhile.

use std::thread;
use std::time::{Duration, Instant};

use ser_sim::testing::PATIENCE;

use crate::faults::Trial;
use crate::judge::{Filled, Verdict, judge};
use crate::tables::Tables;
use crate::{Setting, wanted_rounds};

impl Trial {
    /// The server stops, or runs again.
    pub(crate) fn strike_server(&mut self) -> String {
        let is_hard = self.random.rand_range(0..2) == 0;
        let Some(server) = &self.server else { return String::new() };
        let mode = if is_hard { "immediate" } else { "fast" };
        server.stop(mode);
        let is_back = self.random.rand_range(0..3) > 0;
        if is_back {
            server.run();
        }
        format!("the server stops ({mode}), and runs again: {is_back}")
    }

    /// Waits until the server has exactly what archives have, and judges that.
    pub(crate) fn settle_elsewhere(&mut self) {
        let Some(server) = &self.server else { return };
        server.run();
        let is_only = self.collectors.len() == 1;
        let filled = if is_only { Filled::ByOne } else { Filled::BySeveral };
        let deadline = Instant::now() + PATIENCE;
        loop {
            let verdict = match server.tables() {
                Some(there) => {
                    let mut verdict = judge(&self.plant.books(), &there, filled);
                    if is_only {
                        compare(&there, self.collectors[0].archive(), &mut verdict);
                    }
                    verdict
                }
                None => Verdict { missing: vec!["no archive".to_owned()], ..Verdict::default() },
            };
            if verdict.is_good() {
                return;
            }
            let is_late = Instant::now() > deadline;
            assert!(verdict.wrong.is_empty() && !is_late, "server: {}", self.say(&verdict));
            thread::sleep(Duration::from_millis(100));
        }
    }
}

/// What one has and the other has not.
fn compare(there: &Tables, here: &std::path::Path, verdict: &mut Verdict) {
    let here = Tables::of_file(here).expect("an archive");
    let sorted = |tables: &Tables| {
        let (mut entries, mut evidence) = (tables.entries.clone(), tables.evidence.clone());
        entries.sort();
        evidence.sort();
        (entries, evidence)
    };
    let (entries, evidence) = sorted(there);
    let (our_entries, our_evidence) = sorted(&here);
    let differing = (entries != our_entries, evidence != our_evidence);
    if differing != (false, false) {
        let count = |tables: &Tables| (tables.entries.len(), tables.evidence.len());
        verdict.missing.push(format!("{:?} are there, {:?} here", count(there), count(&here)));
    }
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn a_server_has_exactly_what_the_archive_has() {
    wanted_rounds(5, Setting { is_forwarding: true, ..Setting::default() });
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn two_collectors_that_forward_to_one_server_hide_nothing_of_each_other() {
    let setting = Setting { has_two: true, has_own_archives: true, ..Setting::default() };
    wanted_rounds(5, Setting { is_forwarding: true, ..setting });
}

#[test]
#[ignore = "needs postgres: cargo xtask test"]
fn original_recorders_that_two_collectors_forward_are_filed_once() {
    let setting = Setting { has_two: true, has_own_archives: true, ..Setting::default() };
    wanted_rounds(5, Setting { is_forwarding: true, are_original: true, ..setting });
}
