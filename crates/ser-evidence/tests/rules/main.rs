//! The rules of evidence, tried on worlds that are drawn at random.
//!
//! [`world`] knows the truth and reckons nothing: contacts move, clocks drift and are set, power
//! fails, logs overflow. [`story`] tells of a world what readers and observers would have told.
//! [`judge`] compares what the crate says of a story with the truth, and [`floor`] with what must
//! be said at least. [`adapter`] alone knows how the crate is asked.
//!
//! A seed decides everything. `SER_RULES_SEED=17` tries one seed and tells its story if something is
//! wrong, `SER_RULES_SEEDS=10000` tries that many, from `SER_RULES_FIRST=10000` on if that is said,
//! `SER_RULES_WRONG=1` ends at the first that is wrong. `cargo xtask evidence-mistakes` shows that
//! mistakes in the crate are noticed.

mod adapter;
mod chance;
mod contact;
mod floor;
mod host;
mod incident_judge;
mod input;
mod judge;
mod known;
mod observing;
mod operation;
mod plant;
mod readings;
mod recorder;
mod schedule;
mod story;
mod true_clock;
mod true_time;
mod world;
mod world_is_sound;
mod wrong_judge;

use std::collections::BTreeMap;
use std::ops::Range;

use judge::Fault;
use story::Story;

/// After so many seeds with something wrong, there is enough to be seen.
const MOST_WRONG_SEEDS: u64 = 50;

/// How much of what is wrong is printed.
const MOST_TEXT: usize = 20_000;

/// The seeds to try: the one that the environment names, or so many.
fn seeds(by_default: u64) -> Range<u64> {
    let first = number("SER_RULES_FIRST").unwrap_or(0);
    match (number("SER_RULES_SEED"), number("SER_RULES_SEEDS")) {
        (Some(seed), _) => seed..seed + 1,
        (None, count) => first..first + count.unwrap_or(by_default),
    }
}

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable} is a number, not {text}")))
}

#[test]
fn what_is_said_is_true() {
    try_all(seeds(300));
}

#[test]
#[ignore = "takes a minute"]
fn what_is_said_is_true_in_ten_thousand_worlds() {
    try_all(seeds(10_000));
}

/// What is wrong, with the seeds for each rule.
#[derive(Default)]
struct Wrong {
    by_rule: BTreeMap<&'static str, Vec<u64>>,
    texts: String,
    seeds: u64,
}

impl Wrong {
    fn add(&mut self, seed: u64, faults: Vec<Fault>) {
        self.seeds += u64::from(!faults.is_empty());
        for Fault { rule, text } in faults {
            let seeds = self.by_rule.entry(rule).or_default();
            if seeds.is_empty() && self.texts.len() < MOST_TEXT {
                self.texts += &format!("seed {seed}, {rule}: {text}\n");
            }
            if seeds.last() != Some(&seed) {
                seeds.push(seed);
            }
        }
    }
}

fn try_all(seeds: Range<u64>) {
    let mut wrong = Wrong::default();
    let most_wrong = number("SER_RULES_WRONG").unwrap_or(MOST_WRONG_SEEDS);
    for seed in seeds.clone() {
        wrong.add(seed, judge::faults_of(seed));
        if wrong.seeds == most_wrong {
            wrong.texts += &format!("seeds after {seed} were not tried\n");
            break;
        }
    }
    for (rule, seeds) in &wrong.by_rule {
        let first: Vec<_> = seeds.iter().take(12).collect();
        wrong.texts += &format!("{rule}: {} seeds, first {first:?}\n", seeds.len());
    }
    if wrong.seeds > 0 && seeds.end - seeds.start == 1 {
        wrong.texts += &Story::of(seeds.start).to_string();
    }
    assert!(wrong.seeds == 0, "SER_RULES_SEED=… repeats one seed alone\n{}", wrong.texts);
}
