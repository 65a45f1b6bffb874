//! Nothing lost, nothing twice, nothing wrong, whatever happens: recorders whose moves are all known
//! are collected while computers, lines, recorders and disks fail, and a judge that shares no code
//! with the collector holds the archive against the books.
//!
//! `plant` has recorders and their books, `link` what is between them and a `collector`, `disk` and
//! `faults` what goes wrong, `tables` what is in the archive, and `judge` what is said of it. A failure
//! names its seed; `SER_COLLECT_SEED` begins there, and `SER_COLLECT_ROUNDS` says how many rounds there
//! are.
#![cfg(all(unix, feature = "archive"))]
#![allow(clippy::cast_possible_truncation, reason = "numbers that were drawn from a small range")]

mod chains;
mod collector;
#[path = "../common/mod.rs"]
mod common;
mod directed;
mod disk;
mod faults;
mod judge;
mod link;
#[cfg(feature = "postgres")]
mod needs_postgres;
mod needs_python_readers;
mod plant;
#[cfg(feature = "postgres")]
mod postgres;
mod tables;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use oorandom::Rand64;

use collector::{Collector, Order};
use disk::Disk;
use faults::Trial;
use plant::Plant;

/// How many rounds have the same plant and archive.
const ROUNDS_OF_PLANT: u64 = 5;

/// A number that may be set from outside.
fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().map_or(default, |text| text.parse().expect("a number"))
}

/// What is tried.
#[derive(Clone, Copy, Default)]
struct Setting {
    /// Whether two collectors take turns.
    has_two: bool,
    /// Whether each of them has an archive of its own.
    has_own_archives: bool,
    /// Whether recorders do not say which they are.
    are_original: bool,
    /// Whether everything is forwarded to a server.
    #[cfg(feature = "postgres")]
    is_forwarding: bool,
}

/// A plant with its collectors.
fn trial(seed: u64, setting: Setting) -> Trial {
    let mut random = Rand64::new(seed.into());
    let sizes = match setting.are_original {
        true => [2048; 4],
        false => [2048, 300, 64, 1000].map(|size| size + random.rand_range(0..2) as u16 - 1),
    };
    let count = random.rand_range(3..5) as usize;
    let collectors = 1 + usize::from(setting.has_two);
    let plant = Plant::start(&sizes[..count], collectors, setting.are_original);
    let disk = Disk::new();
    #[cfg(feature = "postgres")]
    let server = setting.is_forwarding.then(postgres::Server::start);
    #[cfg(feature = "postgres")]
    let address = server.as_ref().map(postgres::Server::address);
    #[cfg(not(feature = "postgres"))]
    let address: Option<String> = None;
    let folder = tempfile::tempdir().expect("a folder");
    let collector = |place: usize| {
        let site = folder.path().join(format!("site{place}.toml"));
        std::fs::write(&site, plant.site(place)).expect("a file");
        let own = if setting.has_own_archives { place } else { 0 };
        let archive = disk.path().join(format!("plant{own}.db"));
        let told = folder.path().join(format!("told{place}"));
        let forward = address.clone();
        Collector::new(Order { name: format!("C{place}"), site, archive, forward, told })
    };
    let collectors = (0..collectors).map(collector).collect();
    let (lock, is_full, happened) = (None, false, Vec::new());
    Trial {
        plant,
        collectors,
        disk,
        _folder: folder,
        random,
        turn: 0,
        lock,
        is_full,
        #[cfg(feature = "postgres")]
        server,
        happened,
    }
}

/// Runs so many rounds, some of them with each plant.
fn rounds(first: u64, count: u64, setting: Setting) {
    let mut number = 0;
    while number < count {
        let seed = first + number / ROUNDS_OF_PLANT;
        let mut trial = trial(seed, setting);
        let run = catch_unwind(AssertUnwindSafe(|| {
            trial.begin();
            for _ in 0..ROUNDS_OF_PLANT.min(count - number) {
                trial.round(number);
                number += 1;
            }
        }));
        let run = run.and_then(|()| {
            trial.collectors.iter_mut().for_each(Collector::end);
            catch_unwind(AssertUnwindSafe(|| chains::check(&trial)))
        });
        if let Err(failure) = run {
            eprintln!("seed {seed}, round {number}");
            resume_unwind(failure);
        }
        println!("seed {seed}: {number} rounds");
    }
}

/// As many rounds as are wanted, or these.
fn wanted_rounds(count: u64, setting: Setting) {
    rounds(number("SER_COLLECT_SEED", 1), number("SER_COLLECT_ROUNDS", count), setting);
}

#[test]
fn two_rounds_of_faults() {
    rounds(1000, 2, Setting::default());
}
