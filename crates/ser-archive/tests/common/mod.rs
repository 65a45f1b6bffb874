//! Archives to try things on, and records to put into them.
#![allow(dead_code, reason = "every test file uses a part of it")]

use std::path::PathBuf;

use ser_archive::{Access, Archive, Batch, Bookmark, Place};
use ser_evidence::record::{
    self, Boot, ClockObservation, CommandRecord, EntryRecord, Gap, HostReading, How, Life,
    LifeRecord, Lost, Outcome, Record, Reference, Watched, Why,
};
use ser_evidence::time::{Bound, Moment, Utc, shown, stamp};
use ser_proto::{Entry, Inputs, Model};

pub(crate) const PROGRAM: &str = "ser-cli 0.1.0";

/// A place for an archive, gone afterwards.
pub(crate) enum Home {
    /// A folder with a file.
    File(tempfile::TempDir),
    /// A database, and a program that runs statements in it.
    Database { address: String, run: Box<dyn Fn(&str)> },
}

impl Home {
    pub(crate) fn new() -> Home {
        Home::File(tempfile::tempdir().unwrap())
    }

    pub(crate) fn place(&self) -> Place {
        match self {
            Home::File(_) => Place::File(self.path()),
            Home::Database { address, .. } => address.parse().unwrap(),
        }
    }

    pub(crate) fn open(&self) -> Archive {
        self.open_for(Access::Write { program: PROGRAM }).unwrap()
    }

    pub(crate) fn open_for(&self, access: Access<'_>) -> ser_archive::Result<Archive> {
        Archive::open(&self.place(), access)
    }

    /// The file.
    pub(crate) fn path(&self) -> PathBuf {
        self.beside("plant.db")
    }

    /// Another file in the same folder.
    pub(crate) fn beside(&self, name: &str) -> PathBuf {
        match self {
            Home::File(folder) => folder.path().join(name),
            Home::Database { address, .. } => panic!("{address} is no file"),
        }
    }

    /// Everybody else's way into the file.
    pub(crate) fn raw(&self) -> rusqlite::Connection {
        rusqlite::Connection::open(self.path()).unwrap()
    }

    /// Runs statements behind our back.
    pub(crate) fn sql(&self, statements: &str) {
        match self {
            Home::File(_) => self.raw().execute_batch(statements).unwrap(),
            Home::Database { run, .. } => run(statements),
        }
    }
}

/// 22 November 2026, 10:00 UTC.
const TEN_US: i64 = 1_795_341_600_000_000;

/// So many seconds after ten.
pub(crate) fn at_s(seconds: i64) -> Moment<Utc> {
    Moment::from_us(TEN_US + seconds * 1_000_000)
}

pub(crate) const LIFE: Life = Life::from_bits(0x0123_4567_89ab_cdef);
pub(crate) const NEXT_LIFE: Life = Life::from_bits(0xfedc_ba98_7654_3210);

/// The entry with this sequence, a second after the one before it.
pub(crate) fn entry(life: Life, sequence: u64) -> EntryRecord {
    let number = i64::try_from(sequence).unwrap();
    let time = stamp(Moment::from_us(TEN_US + number * 1_000_000)).unwrap();
    let input = Inputs(1 << (sequence % 32));
    EntryRecord {
        life,
        sequence: Some(sequence),
        number: u16::try_from(sequence % 2048).unwrap() + 1,
        entry: Entry { time, changed: input, state: input },
        known: EntryRecord::ALL_KNOWN,
    }
}

pub(crate) fn entries(life: Life, sequences: impl IntoIterator<Item = u64>) -> Vec<Record> {
    sequences.into_iter().map(|sequence| Record::Entry(entry(life, sequence))).collect()
}

pub(crate) fn batch(records: Vec<Record>) -> Batch {
    Batch {
        collector: "cellar".to_owned(),
        recorder: "U1-SER1".to_owned(),
        records,
        bookmark: None,
        joins: false,
        at: at_s(0),
    }
}

pub(crate) fn bookmark(life: Life, sequence: u64) -> Bookmark {
    Bookmark {
        life,
        sequence,
        is_exact: true,
        anchor: (sequence > 0).then(|| entry(life, sequence).entry),
        log_size: Some(2048),
        log: (sequence > 2).then_some([7; 20]),
    }
}

pub(crate) fn life(life: Life) -> Record {
    Record::Life(LifeRecord {
        life,
        is_exact: true,
        model: Some(Model::Ser320),
        size: Some(2048),
        erased: None,
    })
}

pub(crate) fn gap(life: Life, after: u64, count: u32) -> Record {
    let (lost, why) = (Lost::Exactly(count), Why::Overwritten);
    Record::Gap(Gap { life, after: Some(after), lost, why })
}

pub(crate) fn host_reading(second: i64) -> HostReading {
    HostReading {
        boot: Boot(7),
        monotonic: Moment::from_us(second * 1_000_000),
        utc: at_s(second),
        utc_doubt_us: Some(20_000),
    }
}

pub(crate) fn watched(life: Life, through: u64) -> Record {
    let (from, to) = (host_reading(0), host_reading(60));
    Record::Watched(Watched { life, from, to, through })
}

/// The clock was set, and this came of it.
pub(crate) fn command(outcome: Outcome) -> Record {
    Record::Command(CommandRecord {
        at: host_reading(1),
        user: "anna".to_owned(),
        host: "desk-7".to_owned(),
        program: PROGRAM.to_owned(),
        peer: "/dev/ttyUSB0".to_owned(),
        command: "set clock to 2026-11-22T10:00:00.000".to_owned(),
        outcome,
    })
}

/// The clock was asked after an entry.
pub(crate) fn observed(life: Life, after: u64) -> Record {
    let newest = entry(life, after).entry;
    let reading = host_reading(after.try_into().unwrap());
    let bound = Bound::new(Some(reading.monotonic.after(-1000)), Some(reading.monotonic));
    Record::Clock(ClockObservation {
        how: How::Query,
        shown: shown(&newest.time).unwrap(),
        at: Reference::Host { bound, reading },
        place: record::Place {
            life,
            after: Some(after),
            before: Some(after),
            newest: Some(newest),
            fellow: None,
        },
    })
}

/// Everything that an archive has of a recorder.
pub(crate) fn everything(archive: &mut Archive, recorder: &str) -> Vec<Record> {
    let mut records = Vec::new();
    archive
        .read(recorder, ser_archive::Window::default(), &mut |record| {
            records.push(record.clone());
            Ok(())
        })
        .unwrap();
    records
}

/// The same, in the order of the archive.
pub(crate) fn in_order(archive: &mut Archive) -> Vec<Record> {
    let (mut records, mut position) = (Vec::new(), 0);
    loop {
        let some = archive.since(position, 3).unwrap();
        let Some(last) = some.last() else { return records };
        assert!(last.position > position);
        position = last.position;
        records.extend(some.into_iter().map(|archived| archived.record));
    }
}
