//! Logs that began anew while nobody looked, and filled again: what the recorder says of its log
//! tells them apart, whatever their entries look like.
#![cfg(unix)]

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::bench::text;
use common::{Running, ser_cli};
use ser_evidence::record::{EntryRecord, Gap, Life, Record, Why};
use ser_files::Source;
use ser_proto::{Command as Asked, Decoded, Identity, MAX_BODY_LEN, Model, Reply};
use ser_sim::testing::PATIENCE;
use ser_sim::{Port, Scenario, SimOptions, Simulator, Step};
use tempfile::TempDir;

/// Entries of the log: few, so that what was read is overwritten soon.
const SIZE: usize = 3;

/// A recorder with a small log, and hosts that remember what they have read.
struct Bench {
    folder: TempDir,
    simulator: Simulator,
    /// Which state input 1 is in.
    is_on: bool,
}

impl Bench {
    fn start() -> Bench {
        let folder = tempfile::tempdir().expect("a folder");
        let options = SimOptions::new(Model::Ser160, Port::tcp("127.0.0.1:0"));
        let simulator = Simulator::start(options).expect("a simulator");
        let bench = Bench { folder, simulator, is_on: false };
        bench.ok("admin", &format!("config --size {SIZE}"));
        bench
    }

    fn state(&self, host: &str) -> PathBuf {
        self.folder.path().join(host)
    }

    fn command(&self, host: &str, arguments: &str) -> Command {
        let mut command = ser_cli();
        command.env("SER_PORT", self.simulator.port()).env("SER_STATE_DIR", self.state(host));
        command.args(["--timeout", "20s"]).args(arguments.split_whitespace());
        command
    }

    fn ok(&self, host: &str, arguments: &str) -> String {
        let output = self.command(host, arguments).output().expect("ser-cli runs");
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// What is new for a host: entries and gaps.
    fn news(&self, host: &str) -> (Vec<EntryRecord>, Vec<Gap>) {
        sorted(&self.ok(host, "read --new --format jsonl"))
    }

    /// So many events.
    fn records(&mut self, events: usize) {
        for _ in 0..events {
            self.is_on = !self.is_on;
            let step = Step { at_ms: 0, input: 1, on: self.is_on };
            self.simulator.play(Scenario::from_steps([step])).expect("it plays");
            self.simulator.wait_played(PATIENCE).expect("it has played");
        }
    }

    /// Another host erases the log, of which this one hears nothing.
    fn erased_by_another(&self) {
        self.ok("admin", "erase --yes");
    }

    /// The life of the log, as the recorder itself says.
    fn life(&self) -> Life {
        let Identity { id, power_ups, life, .. } = identity(self.simulator.port());
        Life::of_recorder(&id.expect("a number").bytes(), power_ups, life)
    }
}

fn sorted(jsonl: &str) -> (Vec<EntryRecord>, Vec<Gap>) {
    let (mut entries, mut gaps) = (Vec::new(), Vec::new());
    for told in Source::new(jsonl.as_bytes(), "").expect("JSON lines") {
        match told.expect("a record").record {
            Record::Entry(entry) => entries.push(entry),
            Record::Gap(gap) => gaps.push(gap),
            _ => {}
        }
    }
    (entries, gaps)
}

fn identity(port: &str) -> Identity {
    use std::io::{Read, Write};
    let address = port.strip_prefix("tcp://").expect("TCP");
    let mut line = std::net::TcpStream::connect(address).expect("the simulator answers");
    for command in [Asked::Read { start: 1, count: 0 }, Asked::Identify] {
        let frame: Vec<u8> = ser_proto::FrameEncoder::new(command.to_body()).collect();
        line.write_all(&frame).expect("sent");
    }
    let mut decoder = ser_proto::FrameDecoder::<MAX_BODY_LEN>::new();
    let mut byte = [0];
    loop {
        line.read_exact(&mut byte).expect("a reply");
        if let Some(Decoded::Frame(body)) = decoder.push(byte[0])
            && let Ok(Reply::Identity(identity)) = Reply::parse(body)
        {
            return identity;
        }
    }
}

fn sequences(entries: &[EntryRecord]) -> Vec<u64> {
    entries.iter().filter_map(|entry| entry.sequence).collect()
}

fn lives(entries: &[EntryRecord]) -> BTreeSet<Life> {
    entries.iter().map(|entry| entry.life).collect()
}

#[test]
fn a_log_that_was_erased_and_has_filled_again_is_another_life() {
    let mut bench = Bench::start();
    bench.records(3);
    let (entries, gaps) = bench.news("host");
    assert_eq!((sequences(&entries), gaps.len()), (vec![1, 2, 3], 0));
    let first = bench.life();
    assert_eq!(lives(&entries), [first].into());

    // Everything that was read is overwritten, and the total is above that of before.
    bench.erased_by_another();
    bench.records(5);
    let (entries, gaps) = bench.news("host");
    let second = bench.life();
    assert_ne!(first, second);
    assert_eq!((sequences(&entries), lives(&entries)), (vec![3, 4, 5], [second].into()));
    let whys: Vec<_> = gaps.iter().map(|gap| (gap.life, gap.after, gap.why)).collect();
    let restart = (first, Some(3), Why::LogBeganAnew);
    assert_eq!(whys, [restart, (second, Some(0), Why::Overwritten)]);

    // That is told once.
    let (entries, gaps) = bench.news("host");
    assert!(entries.is_empty() && gaps.is_empty(), "{entries:?} {gaps:?}");
    bench.records(1);
    let (entries, gaps) = bench.news("host");
    assert_eq!((sequences(&entries), lives(&entries), gaps.len()), (vec![6], [second].into(), 0));
}

#[test]
fn a_power_cycle_and_as_many_events_as_before_are_another_life() {
    let mut bench = Bench::start();
    bench.records(3);
    let (entries, _) = bench.news("host");
    bench.simulator.power_cycle().expect("it is back");
    bench.records(3);
    let (again, gaps) = bench.news("host");
    assert_eq!((sequences(&again), lives(&again)), (vec![1, 2, 3], [bench.life()].into()));
    assert!(lives(&entries).is_disjoint(&lives(&again)));
    assert!(matches!(gaps[..], [Gap { why: Why::LogBeganAnew, .. }]), "{gaps:?}");
}

#[test]
fn an_erase_of_ones_own_is_no_loss_and_the_new_log_has_the_name_that_the_recorder_tells() {
    let mut bench = Bench::start();
    bench.records(2);
    bench.news("host");
    bench.ok("host", "erase --yes");
    bench.records(4);
    let (entries, gaps) = bench.news("host");
    // Of four events a log of three has lost one.
    assert_eq!((sequences(&entries), lives(&entries)), (vec![2, 3, 4], [bench.life()].into()));
    assert!(matches!(gaps[..], [Gap { after: Some(0), why: Why::Overwritten, .. }]), "{gaps:?}");
}

#[test]
fn a_clock_that_is_set_while_the_log_is_empty_is_that_of_the_log_to_come() {
    let mut bench = Bench::start();
    let set_in = |told: &str| -> BTreeSet<Life> {
        let told = Source::new(told.as_bytes(), "").expect("JSON lines");
        let life = |record: Record| match record {
            Record::Clock(clock) => Some(clock.place.life),
            _ => None,
        };
        told.filter_map(|told| life(told.expect("a record").record)).collect()
    };
    let set = bench.ok("host", "clock set --format jsonl");
    assert_eq!(set_in(&set), [bench.life()].into());
    // The log is empty again, and is another one.
    bench.records(1);
    bench.erased_by_another();
    let set = bench.ok("host", "clock set --format jsonl");
    assert_eq!(set_in(&set), [bench.life()].into());
    bench.records(1);
    let (entries, gaps) = bench.news("host");
    assert_eq!((sequences(&entries), lives(&entries)), (vec![1], [bench.life()].into()));
    assert!(matches!(gaps[..], [Gap { why: Why::LogBeganAnew, .. }]), "{gaps:?}");
}

#[test]
fn two_hosts_give_one_life_one_name_and_another_one_keeps_that_which_it_had() {
    let mut bench = Bench::start();
    bench.records(2);
    let names = ["one", "other"].map(|host| lives(&bench.news(host).0));
    assert_eq!(names, [[bench.life()].into(), [bench.life()].into()]);

    // A state of earlier versions, which drew its names.
    let drawn = Life::from_bits(0x1234_5678_9abc_def0);
    let file = state_file(&bench.state("one"));
    let state = fs::read_to_string(&file).expect("a state");
    let (before, log) = state.split_once(",\"log\":").expect("what the recorder said of its log");
    assert!(log.contains("\"life\":"), "{state}");
    let old = before.replace(&bench.life().to_string(), &drawn.to_string()) + "}\n";
    fs::write(&file, old).expect("written");
    bench.records(1);
    let (entries, gaps) = bench.news("one");
    assert_eq!((sequences(&entries), lives(&entries), gaps.len()), (vec![3], [drawn].into(), 0));
    // From now on it knows which log that is.
    bench.erased_by_another();
    bench.records(4);
    let (entries, gaps) = bench.news("one");
    assert_eq!((sequences(&entries), lives(&entries)), (vec![2, 3, 4], [bench.life()].into()));
    assert_eq!((gaps[0].life, gaps[0].why), (drawn, Why::LogBeganAnew));
}

#[test]
fn a_watch_names_a_life_that_begins_under_it_as_others_do() {
    let mut bench = Bench::start();
    bench.records(1);
    // While it is watched, nobody else can ask the recorder.
    let first = bench.life();
    let mut command = bench.command("host", "watch --poll --interval 50ms --format jsonl");
    let mut watch = Running::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
    let lines = watch.lines();
    let next = || {
        let is_entry = |line: &String| line.starts_with("{\"record\":\"entry\"");
        let all = std::iter::from_fn(|| lines.recv_timeout(PATIENCE).ok());
        sorted(&all.into_iter().find(is_entry).expect("an entry")).0
    };
    assert_eq!(lives(&next()), [first].into());
    bench.simulator.power_cycle().expect("it is back");
    bench.records(1);
    let second = lives(&next());
    assert_eq!(watch.interrupt(), Some(0));
    assert_eq!(second, [bench.life()].into());
    // And knows it in the next run.
    bench.erased_by_another();
    bench.records(4);
    assert_eq!(lives(&bench.news("host").0), [bench.life()].into());
}

#[test]
fn whatever_happens_between_two_readings_no_entry_has_two_names_or_that_of_another_life() {
    for seed in 0..6 {
        let mut chance = oorandom::Rand32::new(seed);
        let mut bench = Bench::start();
        let mut seen: BTreeSet<(Life, u64)> = BTreeSet::new();
        for _ in 0..6 {
            match chance.rand_range(0..4) {
                0 => bench.erased_by_another(),
                1 => bench.simulator.power_cycle().expect("it is back"),
                2 => drop(bench.ok("host", "erase --yes")),
                _ => {}
            }
            bench.records(usize::try_from(chance.rand_range(0..6)).expect("few"));
            let (entries, _) = bench.news("host");
            for entry in &entries {
                let sequence = entry.sequence.expect("counted");
                assert_eq!(entry.life, bench.life(), "seed {seed}: {entry:?}");
                assert!(seen.insert((entry.life, sequence)), "seed {seed}: twice: {entry:?}");
            }
        }
    }
}

fn state_file(folder: &Path) -> PathBuf {
    let files = fs::read_dir(folder).expect("a folder").map(|file| file.expect("a file").path());
    let is_state = |path: &PathBuf| path.extension().is_some_and(|end| end == "json");
    files.into_iter().find(is_state).expect("a state file")
}
