//! What is in one archive is given to another one.

use std::path::Path;

use ser_archive::{Access, Archive, Batch, Place};
use ser_collector::forward;
use ser_evidence::record::{EntryRecord, Life, Record};
use ser_evidence::time::{Moment, stamp};
use ser_proto::{Entry, Inputs};

fn entry(life: u64, sequence: u64) -> EntryRecord {
    let at_us = 1_795_341_600_000_000 + i64::try_from(sequence).unwrap() * 1_000_000;
    let input = Inputs(1 << (sequence % 32));
    EntryRecord {
        life: Life::from_bits(life),
        sequence: Some(sequence),
        number: 1,
        entry: Entry { time: stamp(Moment::from_us(at_us)).unwrap(), changed: input, state: input },
        known: EntryRecord::ALL_KNOWN,
    }
}

fn archive(folder: &Path, name: &str) -> Archive {
    let place = Place::File(folder.join(name));
    Archive::open(&place, Access::Write { program: "a test" }).unwrap()
}

/// An archive in which a collector calls the life of a log as it likes.
fn collected(
    folder: &Path,
    collector: &str,
    life: u64,
    sequences: std::ops::RangeInclusive<u64>,
) -> Archive {
    let mut archive = archive(folder, collector);
    let batch = Batch {
        collector: collector.to_owned(),
        recorder: "U1".to_owned(),
        records: sequences.map(|sequence| Record::Entry(entry(life, sequence))).collect(),
        bookmark: None,
        joins: true,
        at: Moment::from_us(0),
    };
    archive.append(&[batch]).unwrap();
    archive
}

fn give_all(from: &mut Archive, to: &mut Archive) -> u64 {
    let (mut position, mut entries) = (0, 0);
    loop {
        let given = forward(from, to, &mut position).unwrap();
        entries += given.entries;
        assert_eq!(given.conflicts, 0);
        if given.rows == 0 {
            return entries;
        }
    }
}

#[test]
fn two_readings_of_one_log_are_filed_once_whichever_is_given_first() {
    for late_first in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        // One collector has read the log from its beginning, the other what the ring still held.
        let mut early = collected(folder.path(), "cellar", 7, 1..=5000);
        let mut late = collected(folder.path(), "tower", 9, 2953..=5100);
        let mut all = archive(folder.path(), "all");
        let mut given = [&mut early, &mut late];
        if late_first {
            given.reverse();
        }
        let entries: u64 = given.into_iter().map(|from| give_all(from, &mut all)).sum();
        assert_eq!(entries, 5100, "late first: {late_first}");
        assert_eq!(all.lives("U1").unwrap().len(), 1);
    }
}
