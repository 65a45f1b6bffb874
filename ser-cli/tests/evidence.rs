//! What the command line writes down for a later report, held against the simulator's clock.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::{BufReader, Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use common::bench::{Bench, text};
use common::{Running, events, is_kept, ser_cli};
use ser_evidence::record::{ClockObservation, How, Life, LifeRecord, Record, Reference, Watched};
use ser_evidence::time::{Host, Moment, shown};
use ser_files::Source;
use ser_proto::{Command, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, ReadReply, Reply};
use ser_sim::testing::{Kind, PATIENCE};

const SET: How = How::Set { broadcast: None };

/// The records in JSON lines, all of which must be ours.
fn records(jsonl: &str) -> Vec<Record> {
    let source = Source::new(jsonl.as_bytes(), "").expect("JSON lines");
    source.map(|told| told.expect("a record").record).collect()
}

/// What was kept beside the state file.
fn kept(bench: &Bench) -> Vec<Record> {
    kept_in(&bench.folder.path().join("state"))
}

fn kept_in(folder: &Path) -> Vec<Record> {
    let files = fs::read_dir(folder).expect("a folder").map(|file| file.expect("a file").path());
    let file = files.into_iter().find(|path| is_kept(path)).expect("what was kept");
    let file = fs::File::open(file).expect("opened");
    let source = Source::new(BufReader::new(file), "").expect("JSON lines");
    source.map(|told| told.expect("a record").record).collect()
}

fn clocks(records: &[Record]) -> Vec<ClockObservation> {
    let clock = |record: &Record| match record {
        Record::Clock(clock) => Some(*clock),
        _ => None,
    };
    records.iter().filter_map(clock).collect()
}

fn watched(records: &[Record]) -> Watched {
    let watched = records.iter().find_map(|record| match record {
        Record::Watched(watched) => Some(*watched),
        _ => None,
    });
    watched.expect("for which time nothing is missing")
}

fn life(records: &[Record]) -> LifeRecord {
    let life = records.iter().find_map(|record| match record {
        Record::Life(life) => Some(*life),
        _ => None,
    });
    life.expect("a life")
}

/// The least and the most that the recorder's clock is ahead of the host's, in microseconds.
fn ahead_us(clock: &ClockObservation) -> (i64, i64) {
    let Reference::Host { bound, .. } = clock.at else { panic!("{clock:?}") };
    let ends = (bound.lo().expect("an end"), bound.hi().expect("an end"));
    let us = |end: Moment<Host>| clock.shown.us() - end.us();
    (us(ends.1), us(ends.0))
}

#[test]
fn a_set_clock_and_the_entries_after_it_tell_of_the_same_clock() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.contacts("0,3,1", 1);
    let set = bench.run("clock set --at 2026-11-22T10:00:00");
    assert_eq!(text(&set.stdout), "2026-11-22T10:00:00.000\n");
    assert!(text(&set.stderr).contains("exact to ± "), "{}", text(&set.stderr));
    let seen = clocks(&kept(&bench));
    let [before, set, after] = seen[..] else { panic!("three observations: {seen:?}") };
    assert_eq!([before.how, set.how, after.how], [How::Query, SET, How::Query]);
    let (least, most) = ahead_us(&set);
    let (at_least, at_most) = ahead_us(&after);
    assert!(least <= at_least && at_most <= most, "asked, it is known better: {set:?} {after:?}");
    let (earlier, _) = ahead_us(&before);
    assert!((earlier - least).abs() > 3_600_000_000, "it showed the time of the simulator");
    assert_eq!((set.place.after, set.place.before), (Some(1), Some(1)));
    assert_eq!(set.place.newest.map(|entry| entry.changed.0), Some(0b100));

    // The first reading has seen nothing before. The second has.
    let first = records(&bench.ok("read --new --format jsonl"));
    let [told, now] = clocks(&first)[..] else { panic!("{first:?}") };
    assert_eq!(told, set, "what clock set has seen");
    assert_eq!(now.how, How::Query);
    let earlier = watched(&first);
    assert_eq!((earlier.life, earlier.through), (life(&first).life, 1));
    bench.contacts("0,3,0\n5,4,1\n9,4,0", 3);
    let second = records(&bench.ok("read --new --format jsonl"));
    let [began, ended, now] = clocks(&second)[..] else { panic!("first, last, now: {second:?}") };
    assert_eq!((now.how, now.place.after, now.place.before), (How::Query, Some(4), Some(4)));
    assert_eq!((began.place.after, ended.place.after), (Some(2), Some(4)));
    let (least, most) = ahead_us(&set);
    for seen in [began, ended] {
        assert_eq!((seen.how, seen.place.life), (How::Event, earlier.life));
        let (at_least, at_most) = ahead_us(&seen);
        assert!(at_least <= most && least <= at_most, "{set:?} {seen:?}");
    }
    assert!(watched(&second).from.monotonic >= earlier.to.monotonic);
    assert_eq!(watched(&second).through, 4);
    assert_eq!(clocks(&kept(&bench)).len(), 3 + 1 + 3);
    let all = records(&bench.ok("read --format jsonl"));
    assert_eq!(clocks(&all)[..1], [set], "a reading of everything tells of the setting, too");
    let [_, unnamed] = clocks(&all)[..] else { panic!("{all:?}") };
    assert_eq!((unnamed.how, unnamed.place.life), (How::Query, Life::UNKNOWN));
    assert_eq!(unnamed.place.newest, ended.place.newest, "by which its life is found");
}

#[test]
fn a_log_that_was_erased_by_command_names_the_one_before() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.contacts("0,3,1", 1);
    let before = life(&records(&bench.ok("read --new --format jsonl")));
    bench.ok("erase --yes");
    bench.contacts("0,3,0", 1);
    let after = life(&records(&bench.ok("read --new --format jsonl")));
    assert_eq!((after.erased, before.erased), (Some(before.life), None));
    assert!(after.is_exact);
}

#[test]
fn every_line_of_a_continued_file_is_read_and_the_layout_is_told_once() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.contacts("0,3,1\n1,4,1", 2);
    let log = bench.folder.path().join("log");
    for _ in 0..2 {
        let file = fs::File::options().append(true).create(true).open(&log).expect("a file");
        let run = bench.command("read --new --format jsonl").stdout(file).status();
        assert!(run.expect("ser-cli runs").success());
    }
    let text = fs::read_to_string(&log).expect("text");
    assert_eq!(text.matches("\"record\":\"file\"").count(), 1, "{text}");
    assert_eq!((events(&text).len(), records(&text).len()), (2, 2 + 2 * 4));
    let entries = records(&text).into_iter().filter_map(|record| match record {
        Record::Entry(entry) => Some(entry),
        _ => None,
    });
    assert!(entries.map(|entry| shown(&entry.entry.time)).all(|shown| shown.is_some()));
}

#[test]
fn watch_says_at_its_end_for_which_time_nothing_is_missing() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.contacts("0,3,1", 1);
    let mut command = bench.command("watch --poll --interval 50ms --format jsonl");
    let mut watch = Running::start(command.stdout(Stdio::piped()).stderr(Stdio::null()));
    let lines = watch.lines();
    let next = |kind: &str| {
        let is_it = |line: &String| line.starts_with(&format!("{{\"record\":\"{kind}\""));
        std::iter::from_fn(|| lines.recv_timeout(PATIENCE).ok()).find(is_it).expect(kind)
    };
    next("file");
    next("entry");
    let asked = next("clock");
    assert!(matches!(clocks(&records(&asked))[..], [ClockObservation { how: How::Query, .. }]));
    // It is seen between two looks, and the clock with it.
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    input.write_all(b"ms,input,state\n0,2,1\n\n").expect("the simulator reads");
    next("entry");
    let seen = next("clock");
    assert!(matches!(clocks(&records(&seen))[..], [ClockObservation { how: How::Event, .. }]));
    assert_eq!(watch.interrupt(), Some(0));
    let last = next("clock");
    assert!(matches!(clocks(&records(&last))[..], [ClockObservation { how: How::Query, .. }]));
    let told = watched(&records(&next("watched")));
    assert_eq!((told.through, watched(&kept(&bench))), (2, told));
    assert!(told.from.monotonic < told.to.monotonic);
}

#[test]
fn a_setting_tells_its_records_and_keeps_the_same_ones() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.contacts("0,3,1", 1);
    let told = bench.ok("clock set --format jsonl");
    assert_eq!(records(&told), kept(&bench));
    assert_eq!(clocks(&records(&told)).len(), 3);
    // Together with entries it is a file that reports take.
    let log = bench.folder.path().join("log");
    fs::write(&log, told + &bench.ok("read --format jsonl")).expect("written");
    let report = bench.ok(&format!("report --last --input {}", log.display()));
    assert!(report.contains("first-out  input 3 ON"), "{report}");
    assert!(!report.contains("contradict") && !report.contains("never observed"), "{report}");
}

#[test]
fn a_clock_that_nobody_set_is_known_by_asking_for_it() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.ok("clock set --at 2000-01-01T00:00:00");
    let state = bench.folder.path().join("state");
    fs::remove_dir_all(state).expect("what is remembered is forgotten");
    bench.contacts("0,3,1", 1);
    let log = bench.folder.path().join("log");
    fs::write(&log, bench.ok("read --format jsonl")).expect("written");
    let merged = bench.ok(&format!("merge --input {}", log.display()));
    let utc = merged.lines().nth(1).expect("a row").to_owned();
    let this_year = host_year();
    assert!(utc.contains(&format!("{this_year}-")), "{merged}");
}

/// The year by this computer's clock.
fn host_year() -> String {
    let date = std::process::Command::new("date").args(["-u", "+%Y"]).output().expect("date runs");
    text(&date.stdout).trim().to_owned()
}

/// A recorder with an empty log whose answers to the first `swallowed` settings of its clock are
/// lost. Returns its port.
fn unit_that_swallows(swallowed: u32) -> String {
    original(swallowed).0
}

/// The same, and how often somebody has asked who it is. It answers the commands of the manual.
fn original(mut swallowed: u32) -> (String, Arc<AtomicUsize>) {
    let asked = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&asked);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = format!("tcp://{}", listener.local_addr().expect("an address"));
    thread::spawn(move || {
        let mut client = listener.accept().expect("a client").0;
        let (mut decoder, mut bytes) = (FrameDecoder::<MAX_BODY_LEN>::new(), [0; 256]);
        loop {
            let count = client.read(&mut bytes).unwrap_or_default();
            if count == 0 {
                // The next run of the program.
                client = listener.accept().expect("a client").0;
                continue;
            }
            for &byte in &bytes[..count] {
                let Some(Decoded::Frame(body)) = decoder.push(byte) else { continue };
                let reply = match Command::parse(body) {
                    Ok(Command::SetClock(_)) if swallowed > 0 => {
                        swallowed -= 1;
                        continue;
                    }
                    Ok(Command::SetClock(_)) => Reply::ClockSet,
                    Ok(Command::Read { start, .. }) => Reply::Read(ReadReply {
                        start,
                        total: 0,
                        next_slot: 0,
                        model: None,
                        entries: heapless::Vec::new(),
                    }),
                    Ok(Command::Identify) => {
                        counted.fetch_add(1, Ordering::Relaxed);
                        continue;
                    }
                    _ => continue,
                };
                let frame: Vec<u8> = FrameEncoder::new(reply.to_body()).collect();
                client.write_all(&frame).expect("the client reads");
            }
        }
    });
    (port, asked)
}

fn set_clock(port: &str, folder: &Path) -> Output {
    let mut command = ser_cli();
    command.env("SER_PORT", port).env("SER_STATE_DIR", folder);
    command.args(["--timeout", "200ms", "--retries", "1", "clock", "set"]);
    command.output().expect("ser-cli runs")
}

#[test]
fn an_original_recorder_is_asked_once_who_it_is_and_not_in_later_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let (port, asked) = original(0);
    for _ in 0..3 {
        let set = set_clock(&port, folder.path());
        assert_eq!(set.status.code(), Some(0), "{}", text(&set.stderr));
        assert_eq!(asked.load(Ordering::Relaxed), 1);
    }
    let kept = kept_in(folder.path());
    assert!(
        clocks(&kept).iter().all(|clock| clock.how == SET),
        "as without the extension: {kept:?}"
    );
    // Who wants to know what it tells now has it asked again.
    let mut time = ser_cli();
    time.env("SER_PORT", &port).env("SER_STATE_DIR", folder.path());
    let time = time.args(["--timeout", "200ms", "time"]).output().expect("ser-cli runs");
    assert_eq!(time.status.code(), Some(1));
    assert!(text(&time.stdout).contains("cannot be asked: an original recorder"), "{time:?}");
    assert!(text(&time.stderr).contains("hint: ser-cli clock set"), "{time:?}");
    assert_eq!(asked.load(Ordering::Relaxed), 2);
    // Of another one nothing is known.
    let (other, asked) = original(0);
    set_clock(&other, folder.path());
    assert_eq!(asked.load(Ordering::Relaxed), 1);
}

#[test]
fn a_setting_that_is_not_certain_is_a_place_where_the_clock_may_have_been_set() {
    let folder = tempfile::tempdir().expect("a folder");
    // Answered the second time: either attempt may be the one that counts.
    let repeated = set_clock(&unit_that_swallows(1), &folder.path().join("repeated"));
    assert_eq!(repeated.status.code(), Some(0), "{}", text(&repeated.stderr));
    assert!(text(&repeated.stderr).contains("more than once"), "{}", text(&repeated.stderr));
    let silent = set_clock(&unit_that_swallows(u32::MAX), &folder.path().join("silent"));
    assert_eq!(silent.status.code(), Some(1));
    for name in ["repeated", "silent"] {
        let kept = kept_in(&folder.path().join(name));
        let [Record::Step(step)] = &kept[..] else { panic!("{name}: {kept:?}") };
        assert_eq!((step.place.after, step.place.newest), (Some(0), None));
    }
}
