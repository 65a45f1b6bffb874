//! A plant of two recorders, months of it, in an archive and as the same records in a file.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use oorandom::Rand64;
use ser_archive::{Access, Archive, Batch, Place};
use ser_evidence::record::{
    self, Boot, ClockObservation, ClockStep, EntryRecord, Gap, HostReading, How, Life, LifeRecord,
    Lost, Record, Reference, SiteRecord, Watched, Why,
};
use ser_evidence::time::{Bound, Moment, stamp};
use ser_files::jsonl;
use ser_proto::{Entry, Inputs};
use tempfile::TempDir;

use super::ser_cli;

/// 1 March 2026, midnight in UTC, in microseconds.
pub(crate) const BEGIN_US: i64 = 1_772_323_200_000_000;
pub(crate) const HOUR_US: i64 = 3_600_000_000;
pub(crate) const DAY_US: i64 = 24 * HOUR_US;

pub(crate) const SITE: &str = r#"site = "Northfield"
time_zone = "UTC"
[[recorder]]
name = "U1"
clock = "utc"
[[recorder]]
name = "U2"
clock = "utc"
[[point]]
recorder = "U1"
input = 1
name = "86 lockout"
role = "86"
group = "protection"
[[point]]
recorder = "U1"
input = 2
name = "52a"
[[point]]
recorder = "U2"
input = 1
name = "27 undervoltage"
[[group]]
name = "protection"
first_out = true
"#;

/// A reading of the host's clocks.
pub(crate) fn reading(utc_us: i64) -> HostReading {
    HostReading {
        boot: Boot(7),
        monotonic: Moment::from_us(utc_us - BEGIN_US + DAY_US),
        utc: Moment::from_us(utc_us),
        utc_doubt_us: Some(2000),
    }
}

/// Everything that was read of one recorder.
#[derive(Default)]
pub(crate) struct Log {
    pub(crate) records: Vec<Record>,
    sequence: u64,
    state: u32,
}

impl Log {
    /// An input moves at a time, and the clock shows another one by so much.
    pub(crate) fn moves(&mut self, life: Life, input: u8, at_us: i64, ahead_us: i64) -> Entry {
        let changed = 1_u32 << (input - 1);
        self.state ^= changed;
        self.sequence += 1;
        let shown_us = (at_us + ahead_us).div_euclid(1000) * 1000;
        let entry = Entry {
            changed: Inputs(changed),
            state: Inputs(self.state),
            time: stamp(Moment::from_us(shown_us)).expect("a stamp"),
        };
        self.records.push(Record::Entry(EntryRecord {
            life,
            sequence: Some(self.sequence),
            number: u16::try_from((self.sequence - 1) % 2048).expect("small") + 1,
            entry,
            known: EntryRecord::ALL_KNOWN,
        }));
        entry
    }

    /// The clock was asked, right after an entry.
    pub(crate) fn asked(&mut self, life: Life, entry: Entry, at_us: i64, ahead_us: i64) {
        let reading = reading(at_us);
        let shown_us = (at_us + ahead_us).div_euclid(1000) * 1000;
        let at = reading.monotonic.after(shown_us - at_us - ahead_us);
        let after = Some(self.sequence);
        self.records.push(Record::Clock(ClockObservation {
            how: How::Query,
            shown: Moment::from_us(shown_us),
            at: Reference::Host {
                bound: Bound::new(Some(at.after(-3000)), Some(at.after(3000))),
                reading,
            },
            place: record::Place { life, after, before: after, newest: Some(entry), fellow: None },
        }));
        let (from, to, through) = (reading, reading, self.sequence);
        self.records.push(Record::Watched(Watched { life, from, to, through }));
    }

    fn begin(&mut self, life: Life) {
        let is_exact = true;
        self.sequence = 0;
        let (model, size, erased) = (None, Some(2048), None);
        self.records.push(Record::Life(LifeRecord { life, is_exact, model, size, erased }));
    }

    /// Entries that nobody could read.
    pub(crate) fn loses(&mut self, life: Life, count: u32) {
        let (after, lost) = (Some(self.sequence), Lost::Exactly(count));
        self.records.push(Record::Gap(Gap { life, after, lost, why: Why::Overwritten }));
        self.sequence += u64::from(count);
    }

    /// Bursts of changes over some months, with what happens to recorders in such a time: a power
    /// failure, overwritten entries, a clock that shows the year 2000 or is set wrong for weeks.
    pub(crate) fn of_months(seed: u128, first_life: u64) -> Log {
        let mut random = Rand64::new(seed);
        let mut log = Log::default();
        let mut life = Life::from_bits(first_life);
        log.begin(life);
        let mut ahead_us = 250_000;
        for day in 0..120 {
            match day {
                30 => {
                    life = Life::from_bits(first_life + 1);
                    log.begin(life);
                    ahead_us = -26 * 365 * DAY_US;
                }
                33 => ahead_us = log.is_set(life, day, 40_000),
                60 => ahead_us = log.is_set(life, day, 100 * DAY_US),
                75 => ahead_us = log.is_set(life, day, -90_000),
                90 => log.loses(life, 7),
                _ => {}
            }
            for quarter in 0..4 {
                let hour = i64::try_from(random.rand_range(0..12)).expect("small");
                if hour < 6 {
                    let at_us = day * DAY_US + (6 * quarter + hour) * HOUR_US;
                    log.burst(&mut random, (life, BEGIN_US + at_us + 400_000, ahead_us));
                }
            }
        }
        log
    }

    /// Somebody sets the clock.
    fn is_set(&mut self, life: Life, day: i64, ahead_us: i64) -> i64 {
        let reading = reading(BEGIN_US + day * DAY_US - 1000);
        let after = Some(self.sequence);
        let place = record::Place { life, after, before: after, newest: None, fellow: None };
        self.records.push(Record::Step(ClockStep { place, reading }));
        ahead_us
    }

    fn burst(&mut self, random: &mut Rand64, (life, first, ahead_us): (Life, i64, i64)) {
        let mut at_us = first;
        let mut newest = None;
        for _ in 0..=random.rand_range(0..6) {
            let input = u8::try_from(random.rand_range(1..9)).expect("small");
            newest = Some(self.moves(life, input, at_us, ahead_us));
            at_us += 200_000 + 1000 * i64::try_from(random.rand_range(1..90)).expect("small");
        }
        if let Some(newest) = newest {
            self.asked(life, newest, at_us + 30_000_000, ahead_us);
        }
    }
}

/// A folder with an archive, and with the same records in a file.
pub(crate) struct Plant(pub(crate) TempDir);

impl Plant {
    /// Months of two recorders.
    pub(crate) fn of_months(seed: u64) -> Plant {
        let seed = u128::from(seed);
        let plant = Plant(tempfile::tempdir().expect("a folder"));
        plant.add("U1", &Log::of_months(seed, 0x1000).records, true);
        plant.add("U2", &Log::of_months(seed + 1000, 0x2000).records, true);
        plant
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn open(&self) -> Archive {
        let place = Place::File(self.path("plant.db"));
        Archive::open(&place, Access::Write { program: "test 1" }).expect("an archive")
    }

    /// Adds records to the archive, and to the file.
    pub(crate) fn add(&self, recorder: &str, records: &[Record], in_file: bool) {
        let mut archive = self.open();
        for part in records.chunks(50) {
            let batch = Batch {
                collector: "cellar".to_owned(),
                recorder: recorder.to_owned(),
                records: part.to_vec(),
                bookmark: None,
                joins: false,
                at: Moment::from_us(BEGIN_US),
            };
            archive.append(&[batch]).expect("it is added");
        }
        if in_file {
            let mut text = fs::read(self.path("all.jsonl")).unwrap_or_default();
            let mut writer = jsonl::Writer::new(&mut text);
            for record in records {
                writer.record(recorder, record).expect("it is written");
            }
            fs::write(self.path("all.jsonl"), text).expect("a file");
        }
        fs::write(self.path("plant.toml"), SITE).expect("a file");
    }

    /// A version of the site file, in use from a time on.
    pub(crate) fn add_site(&self, at_us: i64, text: &str) {
        let site = SiteRecord { at: reading(at_us), text: text.to_owned() };
        self.add("U1", &[Record::Site(site)], false);
    }

    pub(crate) fn run(&self, arguments: &str) -> Output {
        self.run_words(&arguments.split_whitespace().collect::<Vec<_>>())
    }

    pub(crate) fn run_words(&self, arguments: &[&str]) -> Output {
        let mut command = ser_cli();
        command.current_dir(self.0.path()).env("SER_STATE_DIR", self.path("state"));
        command.args(arguments).output().expect("ser-cli runs")
    }

    /// Standard output of a command that ends with this code.
    pub(crate) fn ends(&self, code: i32, arguments: &str) -> String {
        let output = self.run(arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {told}");
        String::from_utf8(output.stdout).expect("text")
    }

    pub(crate) fn ok(&self, arguments: &str) -> String {
        self.ends(0, arguments)
    }

    pub(crate) fn json(&self, arguments: &str) -> serde_json::Value {
        serde_json::from_str(&self.ok(&format!("{arguments} --format json"))).expect("JSON")
    }
}

/// A time as the command line takes it.
pub(crate) fn utc(us: i64) -> String {
    let stamp = stamp(Moment::from_us(us.div_euclid(1000) * 1000)).expect("a time");
    format!("{stamp}Z")
}

#[allow(dead_code, reason = "for tests that name files")]
pub(crate) fn name(path: &Path) -> String {
    path.display().to_string()
}
