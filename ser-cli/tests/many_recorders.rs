//! Thirty-two recorders in a storm: each change is archived, or told as overwritten.
#![cfg(all(unix, feature = "archive"))]

mod common;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Instant;

use common::{Running, ser_cli, wait_until};
use rusqlite::Connection;
use ser_proto::Model;
use ser_sim::testing::PATIENCE;
use ser_sim::{Port, Scenario, SimOptions, Simulator, Step};

const RECORDERS: u32 = 32;

/// One each millisecond, for ten seconds.
const CHANGES: u64 = 10_000;

/// A recorder whose contacts move every millisecond for ten seconds, one after the other.
fn storm() -> Scenario {
    let inputs = u64::from(Model::Ser320.inputs());
    Scenario::from_steps((0..CHANGES).map(|at_ms| Step {
        at_ms,
        input: u8::try_from(at_ms % inputs).unwrap() + 1,
        on: (at_ms / inputs) % 2 == 0,
    }))
}

fn start_all(folder: &Path) -> Vec<Simulator> {
    let start = |_| {
        let options = SimOptions::new(Model::Ser320, Port::tcp("127.0.0.1:0"));
        Simulator::start(options).unwrap()
    };
    let recorders: Vec<Simulator> = (0..RECORDERS).map(start).collect();
    let mut site = "site = \"Storm\"\ntime_zone = \"UTC\"\n".to_owned();
    for (number, recorder) in recorders.iter().enumerate() {
        let port = recorder.port();
        write!(site, "[[recorder]]\nname = \"R{number}\"\nport = \"{port}\"\n").unwrap();
    }
    fs::write(folder.join("storm.toml"), site).unwrap();
    recorders
}

/// Entries in the archive, and how many are told to be overwritten; both over all recorders.
fn counted(archive: &Path) -> (u64, u64) {
    let Ok(archive) = Connection::open(archive) else { return (0, 0) };
    let entries = archive.query_row("SELECT count(*) FROM entry", (), |row| row.get::<_, i64>(0));
    let Ok(entries) = entries else { return (0, 0) };
    let mut gaps = archive.prepare("SELECT line FROM evidence WHERE kind = 'gap'").unwrap();
    let lines = gaps.query_map((), |row| row.get::<_, String>(0)).unwrap();
    let lost = lines.map(|line| {
        let gap: serde_json::Value = serde_json::from_str(&line.unwrap()).unwrap();
        assert_eq!(
            (gap["why"].as_str(), gap["count"].as_str()),
            (Some("overwritten"), Some("exactly"))
        );
        gap["lost"].as_u64().unwrap()
    });
    (entries.unsigned_abs(), lost.sum())
}

/// The most memory that a process has had, in KiB.
fn peak_kib(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.and_then(|peak| peak.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0)
}

#[test]
fn a_storm_at_all_recorders_is_archived_or_told_to_the_last_change() {
    let folder = tempfile::tempdir().unwrap();
    let recorders = start_all(folder.path());
    let archive = folder.path().join("storm.db");
    let mut command = ser_cli();
    command.arg("collect").arg("--site").arg(folder.path().join("storm.toml"));
    let log = fs::File::create(folder.path().join("log")).unwrap();
    command.stdout(Stdio::null()).stderr(log);
    let mut collector = Running::start(&mut command);
    let bookmarks = || -> i64 {
        let archive = Connection::open(&archive).ok();
        let count = |archive: Connection| {
            archive.query_row("SELECT count(*) FROM bookmark", (), |row| row.get(0)).ok()
        };
        archive.and_then(count).unwrap_or(0)
    };
    wait_until("all recorders are read", || bookmarks() == i64::from(RECORDERS));
    let began = Instant::now();
    for recorder in &recorders {
        recorder.play(storm()).unwrap();
    }
    for recorder in &recorders {
        recorder.wait_played(PATIENCE).unwrap();
    }
    let played = began.elapsed();
    let all = u64::from(RECORDERS) * CHANGES;
    wait_until("all is archived or told", || {
        let (entries, lost) = counted(&archive);
        entries + lost >= all
    });
    let settled = began.elapsed();
    let peak = peak_kib(collector.0.id());
    assert_eq!(collector.interrupt(), Some(0));
    let (entries, lost) = counted(&archive);
    eprintln!(
        "{entries} archived, {lost} told as overwritten; played in {played:?}, settled after \
         {settled:?}; at most {peak} KiB"
    );
    assert_eq!(entries + lost, all);
    // Thirty-two rings of 2048 entries take 3 MiB as records; a queue without an end would take more
    // than this.
    assert!((1..=200_000).contains(&peak), "{peak} KiB");
}
