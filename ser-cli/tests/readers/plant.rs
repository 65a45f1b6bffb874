//! Recorders that have recorded a lot in thirty hours, with everything that is hard to write.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::PathBuf;

use ser_evidence::record::{EntryRecord, Gap, Life, Lost, Record, Why};
use ser_evidence::time::{Moment, Shown, stamp};
use ser_files::jsonl::Writer;
use ser_proto::{Entry, Inputs};
use tempfile::TempDir;

use crate::common::bench::text;
use crate::common::ser_cli;

/// 2026-11-22T09:00:00.
pub(super) const BEGIN_MS: i64 = 1_795_338_000_000;

/// A recorder's log, entry by entry.
pub(super) struct Log {
    pub(super) name: &'static str,
    pub(super) points: Vec<(u8, String)>,
    /// When, in milliseconds from the beginning, and what changed.
    pub(super) moves: Vec<(i64, u32)>,
    /// After how many of them a few are missing.
    pub(super) gap_after: Option<usize>,
}

impl Log {
    pub(super) fn new(name: &'static str, points: &[String]) -> Log {
        let points = (1..).zip(points.iter().cloned()).collect();
        Log { name, points, moves: Vec::new(), gap_after: None }
    }

    /// The states after each move, beginning with all off.
    pub(super) fn states(&self) -> Vec<(i64, u32)> {
        let mut on = 0;
        let after = |&(at, changed): &(i64, u32)| {
            on ^= changed;
            (at, on)
        };
        self.moves.iter().map(after).collect()
    }

    fn write(&self, desk: &Desk, life: u64) {
        let path = desk.0.path().join(format!("{}.jsonl", self.name));
        let mut lines = Writer::new(File::create_new(path).expect("a file"));
        lines.file("test").expect("written");
        let mut sequence = 0;
        for (place, (at_ms, on)) in self.states().into_iter().enumerate() {
            sequence += 1;
            if self.gap_after == Some(place) {
                let (after, life) = (Some(sequence - 1), Life::from_bits(life));
                let (lost, why) = (Lost::Exactly(3), Why::Overwritten);
                sequence += 3;
                lines
                    .record(self.name, &Record::Gap(Gap { life, after, lost, why }))
                    .expect("written");
            }
            let at = Moment::<Shown>::from_us((BEGIN_MS + at_ms) * 1000);
            let entry = EntryRecord {
                life: Life::from_bits(life),
                sequence: Some(sequence),
                number: u16::try_from(sequence % 2048 + 1).expect("small"),
                entry: Entry {
                    changed: Inputs(self.moves[place].1),
                    state: Inputs(on),
                    time: stamp(at).expect("a time of this century"),
                },
                known: EntryRecord::ALL_KNOWN,
            };
            lines.record(self.name, &Record::Entry(entry)).expect("written");
        }
        lines.flush().expect("written");
    }
}

/// Names that some program may take for something else. Line ends and the like are refused in a
/// site file.
pub(super) fn hostile_names() -> Vec<String> {
    let long = format!("long {}", "n".repeat(195));
    let names = [
        "<b>52-1</b> & 'x'",
        "say \"closed\"",
        "a, b; c",
        "Überstrom Süd",
        "\u{5e9}\u{5dc}\u{5d5}\u{5dd}",
        &long,
        "=1+1",
        "@SUM(A1)",
        "+49",
        "-1",
        "$end",
        "bus [1]",
        "a.b.c",
        "both",
        "1234567890123456",
    ];
    let mut names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    names.extend((names.len() + 1..=32).map(|input| format!("input no. {input}")));
    names
}

/// A folder with a site file and a file of each recorder.
pub(super) struct Desk(pub(super) TempDir);

impl Desk {
    pub(super) fn of(logs: &[&Log]) -> Desk {
        let desk = Desk(tempfile::tempdir().expect("a folder"));
        let mut site = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n".to_owned();
        for log in logs {
            site += &format!("[[recorder]]\nname = \"{}\"\nclock = \"utc\"\n", log.name);
            for (input, point) in &log.points {
                let point = serde_json::to_string(point).expect("a text");
                let recorder = log.name;
                site += &format!(
                    "[[point]]\nrecorder = \"{recorder}\"\ninput = {input}\nname = {point}\n"
                );
            }
        }
        fs::write(desk.path("north.toml"), site).expect("a file");
        for (life, log) in (1..).zip(logs) {
            log.write(&desk, life);
        }
        desk
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Exports everything to a file.
    pub(super) fn export(&self, arguments: &str, to: &str) {
        let mut command = ser_cli();
        command.current_dir(self.0.path()).args(["export", "--site", "north.toml", "--input"]);
        let files = fs::read_dir(self.0.path()).expect("a folder");
        let files = files.map(|file| file.expect("a file").path());
        command.args(files.filter(|path| path.extension().is_some_and(|end| end == "jsonl")));
        command.args(arguments.split_whitespace()).args(["-o", to]);
        let output = command.output().expect("ser-cli runs");
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    }
}

/// Two recorders with all their inputs, one of them with a gap, over thirty hours.
pub(super) fn thirty_hours() -> [Log; 2] {
    let names = hostile_names();
    let mut chance = oorandom::Rand32::new(7);
    let mut log = |name: &'static str| {
        let mut log = Log::new(name, &names);
        let mut at_ms = 0;
        for index in 0..400 {
            // Bursts of some milliseconds between hours of quiet.
            at_ms += match index % 40 {
                0 => 10_700_000 + i64::from(chance.rand_range(0..99_000)),
                _ => 1 + i64::from(chance.rand_range(0..30)),
            };
            log.moves.push((at_ms, 1 << (index % 32) | 1 << chance.rand_range(0..32)));
        }
        log
    };
    let (mut one, other) = (log("U1"), log("U2"));
    one.gap_after = Some(210);
    assert!(one.moves.last().is_some_and(|(at_ms, _)| *at_ms > 29 * 3_600_000));
    [one, other]
}

/// By instant, the states of all recorders together: bits by recorder.
pub(super) fn instants(logs: &[Log; 2]) -> Vec<(i64, [u32; 2])> {
    let mut instants: BTreeMap<i64, [Option<u32>; 2]> = BTreeMap::new();
    for (recorder, log) in logs.iter().enumerate() {
        for (at_ms, on) in log.states() {
            instants.entry(at_ms).or_default()[recorder] = Some(on);
        }
    }
    let mut now = [0; 2];
    let next = |(at_ms, changed): (i64, [Option<u32>; 2])| {
        for (now, changed) in now.iter_mut().zip(changed) {
            *now = changed.unwrap_or(*now);
        }
        (at_ms, now)
    };
    instants.into_iter().map(next).collect()
}
