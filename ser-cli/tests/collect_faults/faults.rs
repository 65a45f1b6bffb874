//! What goes wrong, drawn from a seed: one thing on top of the other for a while, and then all is
//! well again.

use std::thread;
use std::time::{Duration, Instant};

use oorandom::Rand64;
use rusqlite::Connection;
use ser_sim::testing::PATIENCE;

use crate::collector::Collector;
use crate::disk::Disk;
use crate::judge::{Filled, Verdict, has_read_all, judge};
use crate::link::Wiring;
use crate::plant::{Plant, Recorder};
use crate::tables::Tables;

/// How many things happen in a round.
const EVENTS: std::ops::Range<u64> = 25..45;

/// The longest time between two of them.
const PACE_MS: u64 = 100;

/// Longer than a collector waits for an archive that others hold.
const BEYOND_PATIENCE: Duration = Duration::from_millis(10_500);

/// In one round of so many, the archive is held for so long.
const LONG_LOCKS: u64 = 12;

/// A plant with its collectors, to which things happen.
pub(crate) struct Trial {
    pub(crate) plant: Plant,
    pub(crate) collectors: Vec<Collector>,
    pub(crate) disk: Disk,
    /// Site files, and what collectors tell.
    pub(crate) _folder: tempfile::TempDir,
    pub(crate) random: Rand64,
    /// The collector whose links are plugged in.
    pub(crate) turn: usize,
    pub(crate) lock: Option<Connection>,
    pub(crate) is_full: bool,
    /// Where everything is forwarded to.
    #[cfg(feature = "postgres")]
    pub(crate) server: Option<crate::postgres::Server>,
    pub(crate) happened: Vec<String>,
}

impl Trial {
    fn below(&mut self, end: u64) -> u64 {
        self.random.rand_range(0..end)
    }

    fn chance(&mut self, of: u64) -> bool {
        self.below(of) == 0
    }

    fn recorder(&mut self) -> usize {
        let count = self.plant.recorders.len() as u64;
        usize::try_from(self.below(count)).expect("a place")
    }

    /// Lets every recorder say something and waits until all of it is archived.
    pub(crate) fn begin(&mut self) {
        for place in 0..self.plant.recorders.len() {
            self.play(place, 3, 2);
        }
        for collector in &mut self.collectors {
            collector.start(false);
        }
        self.settle_all();
    }

    /// Lets each collector read everything, one after the other.
    pub(crate) fn settle_all(&mut self) {
        for left in (0..self.collectors.len()).rev() {
            self.settle(left == 0);
            self.take_turns();
        }
    }

    /// Whether each collector has an archive of its own.
    fn has_several_archives(&self) -> bool {
        let archives = self.collectors.iter().map(Collector::archive);
        archives.collect::<std::collections::BTreeSet<_>>().len() > 1
    }

    /// A round: faults, all is well again, and the judge.
    pub(crate) fn round(&mut self, number: u64) {
        self.happened.clear();
        for _ in 0..self.random.rand_range(EVENTS) {
            let pause = self.below(PACE_MS);
            thread::sleep(Duration::from_millis(pause));
            self.collectors.iter_mut().for_each(Collector::look);
            self.event();
        }
        if number % LONG_LOCKS == LONG_LOCKS - 1 {
            self.hold_for_long();
        }
        self.settle_all();
        #[cfg(feature = "postgres")]
        self.settle_elsewhere();
    }

    pub(crate) fn play(&mut self, place: usize, moves: u32, longest_ms: u64) {
        let recorder = &mut self.plant.recorders[place];
        recorder.play(&mut self.random, moves, longest_ms);
    }

    fn event(&mut self) {
        let place = self.recorder();
        #[cfg(feature = "postgres")]
        if self.server.is_some() && self.chance(12) {
            let told = self.strike_server();
            return self.happened.push(told);
        }
        if self.collectors.len() > 1 && self.chance(12) {
            let told = self.take_turns();
            return self.happened.push(told);
        }
        let what = self.below(100);
        let told = match what {
            // An original recorder does not say which it is, and no entry shows that another log has
            // taken the place of one that was overwritten.
            66..72 | 84..88 if self.plant.are_original => "nothing".to_owned(),
            0..34 if self.plant.are_original && !self.has_room(place) => "nothing".to_owned(),
            0..34 => {
                let moves = 1 + self.below(40) as u32;
                self.play(place, moves, 6);
                format!("{moves} moves of {place}")
            }
            34..42 => self.stop_collector(true),
            42..46 => self.stop_collector(false),
            46..54 => {
                let is_polling = self.chance(3);
                for collector in &mut self.collectors {
                    collector.ensure(is_polling);
                }
                "collectors run".to_owned()
            }
            54..60 => self.cut(place),
            60..66 => self.replug(place),
            66..72 => self.swap(place),
            72..79 => {
                self.plant.recorders[place].power_cycle();
                format!("power cycle of {place}")
            }
            79..84 => self.erase(place),
            84..88 => self.overrun(place),
            88..92 => self.lock(),
            92..96 => self.fill(),
            _ => self.pause_collector(),
        };
        self.happened.push(told);
    }

    /// Whether the log of this life is not overwritten soon.
    fn has_room(&self, place: usize) -> bool {
        let recorder = &self.plant.recorders[place];
        recorder.moves_of_life() < usize::from(recorder.size) / 2
    }

    fn stop_collector(&mut self, is_killed: bool) -> String {
        let place = self.random.rand_range(0..self.collectors.len() as u64) as usize;
        let is_back = self.chance(2);
        let is_polling = self.chance(3);
        if !is_killed {
            // It would wait for the archive, as long as it is held.
            self.lock = None;
            self.tell_of_archive();
        }
        let collector = &mut self.collectors[place];
        if is_killed {
            collector.kill();
        } else {
            collector.end();
        }
        if is_back {
            collector.start(is_polling);
        }
        format!("collector {place} ends, killed: {is_killed}, starts: {is_back}")
    }

    fn pause_collector(&mut self) -> String {
        let pause = 50 + self.below(400);
        self.collectors.iter().for_each(|collector| collector.pause(true));
        thread::sleep(Duration::from_millis(pause));
        self.collectors.iter().for_each(|collector| collector.pause(false));
        format!("collectors stand still for {pause} ms")
    }

    /// Cuts clients off, or lets them in again.
    fn cut(&mut self, place: usize) -> String {
        let link = &self.plant.links[self.turn][place];
        let before = link.wiring();
        link.wire(Wiring { is_open: !before.is_open, ..before });
        format!("link {place} open: {}", !before.is_open)
    }

    /// Pulls a cable out, or plugs it in again, and no client is told.
    fn replug(&mut self, place: usize) -> String {
        let address = self.plant.recorders[place].address;
        let links = &self.plant.links[self.turn];
        let elsewhere = links.iter().any(|link| link.wiring().to == Some(address));
        let link = &links[place];
        let before = link.wiring();
        let to = match before.to {
            Some(_) => None,
            None if elsewhere => return "nothing to plug in".to_owned(),
            None => Some(address),
        };
        link.wire(Wiring { to, ..before });
        format!("link {place} plugged: {}", to.is_some())
    }

    /// Exchanges two cables, with or without a word to the clients.
    fn swap(&mut self, place: usize) -> String {
        let other = (place + 1) % self.plant.recorders.len();
        let is_silent = self.chance(2);
        let links = &self.plant.links[self.turn];
        let (one, two) = (&links[place], &links[other]);
        let (first, second) = (one.wiring(), two.wiring());
        if !is_silent {
            one.wire(Wiring { to: None, is_open: false, ..first });
            two.wire(Wiring { to: None, is_open: false, ..second });
            thread::sleep(Duration::from_millis(10));
        }
        one.wire(Wiring { to: second.to, ..first });
        two.wire(Wiring { to: first.to, ..second });
        format!("links {place} and {other} exchanged, silently: {is_silent}")
    }

    /// Takes the recorder's cable, erases, and plugs it in again.
    fn erase(&mut self, place: usize) -> String {
        let address = self.plant.recorders[place].address;
        let is_silent = self.chance(2);
        let at = self.plant.links.iter().flatten().find(|link| link.wiring().to == Some(address));
        let wiring = at.map(|link| {
            let before = link.wiring();
            link.wire(Wiring { to: None, is_open: is_silent && before.is_open, ..before });
            (link, before)
        });
        self.plant.recorders[place].erase();
        if let Some((link, before)) = wiring {
            link.wire(before);
        }
        format!("{place} is erased, silently: {is_silent}")
    }

    /// Cuts a recorder off, and lets it record more than its log holds.
    fn overrun(&mut self, place: usize) -> String {
        let size = self.plant.recorders[place].size;
        // A large log takes seconds, so it is not overrun each time.
        if size > 1000 && !self.chance(3) {
            return "no overrun".to_owned();
        }
        let link = &self.plant.links[self.turn][place];
        link.wire(Wiring { is_open: false, ..link.wiring() });
        let moves = u32::from(size) + 1 + self.below(u64::from(size) / 4) as u32;
        self.play(place, moves, 1);
        self.plant.recorders[place].wait();
        if self.chance(2) {
            let link = &self.plant.links[self.turn][place];
            link.wire(Wiring { is_open: true, ..link.wiring() });
        }
        format!("{moves} moves of {place}, which was cut off")
    }

    /// Somebody writes to the archive and does not end, or ends.
    fn lock(&mut self) -> String {
        if self.lock.take().is_some() {
            self.tell_of_archive();
            return "the archive is free".to_owned();
        }
        let Ok(file) = Connection::open(self.collectors[0].archive()) else {
            return "the archive cannot be opened".to_owned();
        };
        let is_held = file.execute_batch("BEGIN IMMEDIATE").is_ok();
        self.lock = is_held.then_some(file);
        self.tell_of_archive();
        format!("the archive is held: {is_held}")
    }

    fn hold_for_long(&mut self) {
        self.free();
        let until = Instant::now() + BEYOND_PATIENCE;
        while self.lock.is_none() && Instant::now() < until {
            self.lock();
        }
        while Instant::now() < until {
            let place = self.recorder();
            if self.has_room(place) {
                self.play(place, 20, 5);
            }
            thread::sleep(Duration::from_millis(20));
            self.plant.recorders[place].wait();
            self.collectors.iter_mut().for_each(Collector::look);
        }
        self.happened.push("the archive is held for long".to_owned());
    }

    fn fill(&mut self) -> String {
        if self.is_full {
            self.is_full = false;
            self.disk.free();
            self.tell_of_archive();
            return "there is room".to_owned();
        }
        self.is_full = true;
        self.tell_of_archive();
        self.is_full = self.disk.fill();
        self.tell_of_archive();
        format!("the disk is full: {}", self.is_full)
    }

    fn free(&mut self) {
        self.lock = None;
        self.is_full = false;
        self.disk.free();
        self.tell_of_archive();
    }

    /// A collector may end by itself where its archive fails it.
    fn tell_of_archive(&mut self) {
        let fails = self.is_full || self.lock.is_some();
        self.collectors.iter_mut().for_each(|collector| collector.archive_fails(fails));
    }

    /// Another collector gets the recorders.
    fn take_turns(&mut self) -> String {
        self.turn = (self.turn + 1) % self.collectors.len();
        self.plant.restore(self.turn);
        format!("all links as they were, for collector {}", self.turn)
    }

    /// Ends all faults, and waits until the judge has nothing to say. What only collectors know that
    /// do not have the recorders may be missing until all had them.
    fn settle(&mut self, is_last: bool) {
        self.free();
        self.plant.restore(self.turn);
        for place in 0..self.plant.recorders.len() {
            let is_quiet = self.collectors.len() == 1 && self.chance(4);
            if !is_quiet {
                let moves = 1 + self.below(8) as u32;
                self.play(place, moves, 3);
            }
        }
        self.plant.recorders.iter().for_each(Recorder::wait);
        let deadline = Instant::now() + PATIENCE;
        loop {
            self.collectors.iter_mut().for_each(Collector::look);
            for collector in &mut self.collectors {
                collector.ensure(false);
            }
            let mut verdict = self.verdict();
            let may_miss = !is_last && self.filled() == Filled::BySeveral;
            if may_miss && verdict.wrong.is_empty() && self.has_read_all() {
                verdict.missing.clear();
            } else if self.collectors.len() > 1 && !self.has_read_all() {
                verdict.missing.push("the collector has not read all".to_owned());
            }
            if verdict.is_good() {
                return;
            }
            assert!(
                verdict.wrong.is_empty() && Instant::now() < deadline,
                "{}",
                self.say(&verdict)
            );
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn filled(&self) -> Filled {
        match self.collectors.len() > 1 && !self.has_several_archives() {
            true => Filled::BySeveral,
            false => Filled::ByOne,
        }
    }

    /// What is to be said of the archive of the collector that has the recorders.
    fn verdict(&self) -> Verdict {
        match Tables::of_file(self.collectors[self.turn].archive()) {
            Ok(tables) => judge(&self.plant.books(), &tables, self.filled()),
            Err(error) => {
                Verdict { missing: vec![format!("no archive: {error}")], wrong: Vec::new() }
            }
        }
    }

    fn has_read_all(&self) -> bool {
        let collector = &self.collectors[self.turn];
        Tables::of_file(collector.archive())
            .is_ok_and(|tables| has_read_all(&self.plant.books(), &tables, collector.name()))
    }

    pub(crate) fn say(&self, verdict: &Verdict) -> String {
        let some =
            |lines: &[String]| lines.iter().take(8).cloned().collect::<Vec<_>>().join("\n  ");
        let told: String = self.collectors.iter().map(Collector::told).collect();
        format!(
            "wrong:\n  {}\nmissing:\n  {}\nhappened:\n  {}\ntold:\n{told}",
            some(&verdict.wrong),
            some(&verdict.missing),
            self.happened.join("\n  "),
        )
    }
}
