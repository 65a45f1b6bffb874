//! An archive of some years of a plant, drawn with a seed, and the same as JSON lines.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use oorandom::Rand64;
use ser_archive::{Access, Archive, Batch, Place};
use ser_evidence::record::{
    self, Boot, ClockObservation, EntryRecord, HostReading, How, Life, LifeRecord, Record,
    Reference, Watched,
};
use ser_evidence::time::{Bound, Moment, stamp};
use ser_files::jsonl;
use ser_proto::{Entry, Inputs};

use crate::measure::Result;

/// 1 January 2021, in microseconds.
const BEGIN_US: i64 = 1_609_459_200_000_000;
pub(crate) const DAY_US: i64 = 86_400_000_000;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    pub(crate) entries: u64,
    pub(crate) recorders: u64,
    /// The time that they take.
    pub(crate) days: u64,
    pub(crate) seed: u64,
}

/// Where it is.
pub(crate) struct Written {
    pub(crate) archive: PathBuf,
    pub(crate) lines: PathBuf,
    /// How large the archive is.
    pub(crate) bytes: u64,
}

/// A recorder while its log is drawn.
struct Recorder {
    name: String,
    life: Life,
    sequence: u64,
    state: u32,
}

impl Recorder {
    fn entry(&mut self, at_us: i64, input: u8) -> Result<EntryRecord> {
        let changed = 1_u32 << (input - 1);
        self.state ^= changed;
        self.sequence += 1;
        let time = stamp(Moment::from_us(at_us / 1000 * 1000)).ok_or("no stamp")?;
        Ok(EntryRecord {
            life: self.life,
            sequence: Some(self.sequence),
            number: u16::try_from((self.sequence - 1) % 2048)? + 1,
            entry: Entry { changed: Inputs(changed), state: Inputs(self.state), time },
            known: EntryRecord::ALL_KNOWN,
        })
    }

    /// What the clock showed, and that nothing was missed until then.
    fn looked_at(&self, at_us: i64, newest: Entry) -> [Record; 2] {
        let reading = HostReading {
            boot: Boot(7),
            monotonic: Moment::from_us(at_us - BEGIN_US),
            utc: Moment::from_us(at_us),
            utc_doubt_us: Some(2000),
        };
        let at = reading.monotonic;
        let (life, after) = (self.life, Some(self.sequence));
        let place =
            record::Place { life, after, before: after, newest: Some(newest), fellow: None };
        let observation = ClockObservation {
            how: How::Query,
            shown: Moment::from_us(at_us / 1000 * 1000),
            at: Reference::Host {
                bound: Bound::new(Some(at.after(-3000)), Some(at.after(3000))),
                reading,
            },
            place,
        };
        let through = self.sequence;
        let watched = Watched { life, from: reading, to: reading, through };
        [Record::Clock(observation), Record::Watched(watched)]
    }
}

/// Writes both. Each day of a recorder is in bursts of some twenty changes, and at its end it is
/// asked for its clock. Two in a thousand lives end each day.
pub(crate) fn write(folder: &Path, plan: Plan) -> Result<Written> {
    let archive_path = folder.join(format!("{}.db", plan.entries));
    let lines_path = folder.join(format!("{}.jsonl", plan.entries));
    let place = Place::File(archive_path.clone());
    let mut archive = Archive::open(&place, Access::Write { program: "bench 1" })?;
    let mut lines = jsonl::Writer::new(BufWriter::new(File::create(&lines_path)?));
    let mut random = Rand64::new(plan.seed.into());
    let mut recorders: Vec<Recorder> = (0..plan.recorders)
        .map(|index| Recorder {
            name: format!("U{:02}", index + 1),
            life: Life::from_bits(((index + 1) << 32) | 1),
            sequence: 0,
            state: 0,
        })
        .collect();
    let of_day = plan.entries.div_ceil(plan.recorders * plan.days);
    let mut left = plan.entries;
    for day in 0..plan.days {
        let begins = BEGIN_US + i64::try_from(day)? * DAY_US;
        let mut batches = Vec::new();
        for recorder in &mut recorders {
            let count = of_day.min(left);
            left -= count;
            let records = records_of_day(&mut random, recorder, (begins, count))?;
            for record in &records {
                lines.record(&recorder.name, record)?;
            }
            batches.push(Batch {
                collector: "bench".to_owned(),
                recorder: recorder.name.clone(),
                records,
                bookmark: None,
                joins: false,
                at: Moment::from_us(begins + DAY_US),
            });
        }
        archive.append(&batches)?;
    }
    lines.flush()?;
    drop(archive);
    let bytes = archive_path.metadata()?.len();
    Ok(Written { archive: archive_path, lines: lines_path, bytes })
}

fn records_of_day(
    random: &mut Rand64,
    recorder: &mut Recorder,
    (begins, count): (i64, u64),
) -> Result<Vec<Record>> {
    let mut records = Vec::new();
    if recorder.sequence == 0 || random.rand_range(0..500) == 0 {
        if recorder.sequence > 0 {
            recorder.life = Life::from_bits(recorder.life.bits() + 1);
            recorder.sequence = 0;
        }
        let (life, is_exact) = (recorder.life, true);
        let (model, size, erased) = (None, Some(2048), None);
        records.push(Record::Life(LifeRecord { life, is_exact, model, size, erased }));
    }
    let bursts = count.div_ceil(20).max(1);
    let apart_us = DAY_US / i64::try_from(bursts + 1)?;
    let mut newest = None;
    let mut at_us = begins;
    for index in 0..count {
        if index % 20 == 0 {
            at_us = begins + i64::try_from(index / 20)? * apart_us + 60_000_000;
        }
        at_us += 1000 * i64::try_from(random.rand_range(1..200))?;
        let input = u8::try_from(random.rand_range(1..33))?;
        let entry = recorder.entry(at_us, input)?;
        newest = Some(entry.entry);
        records.push(Record::Entry(entry));
    }
    if let Some(newest) = newest {
        records.extend(recorder.looked_at(begins + DAY_US - 60_000_000, newest));
    }
    Ok(records)
}

/// A time on a day, as the command line takes it.
pub(crate) fn time_on(day: u64) -> Result<String> {
    let at = BEGIN_US + i64::try_from(day)? * DAY_US + DAY_US / 2;
    let stamp = stamp(Moment::from_us(at)).ok_or("no time")?;
    Ok(format!("{stamp}Z"))
}
