//! Archives that earlier versions made are read and written by this one.
//!
//! A file of each schema is in `tests/past`, with something in every table. It is never made anew:
//! what programs of that time wrote is what has to be understood.

mod common;

use std::path::Path;

use common::*;
use ser_archive::{Access, Archive, Keep};
use ser_evidence::record::Record;
use ser_proto::Inputs;
use sha2::{Digest, Sha256};

/// The files, and the digests of the heads of their chains.
const FILES: [(&str, [&str; 2]); 1] = [("schema-1.db", HEADS_1)];

const HEADS_1: [&str; 2] = [
    "b9cbfdaabfe6bd538a6129212bce969ef619075486bdde3df85521d560dd4f13",
    "66951b3cc81816eeade8296bc104bff59d1ac04d192da0104e639f8f43b8651f",
];

/// What is in a file of schema 1: a chain with a checkpoint, conflicts and a bookmark, and another
/// one whose life is filed under the name that the first one gave.
fn fill(archive: &mut Archive) {
    let mut conflict = entry(LIFE, 2);
    conflict.entry.state = Inputs(0);
    let mut old = batch([entries(LIFE, 1..=5), vec![Record::Entry(conflict)]].concat());
    old.at = at_s(-1_000_000);
    archive.append(&[old]).unwrap();
    let known = vec![life(LIFE), observed(LIFE, 7), gap(LIFE, 9, 2), watched(LIFE, 20)];
    let mut new = batch([known, entries(LIFE, [6, 7, 8, 9]), entries(LIFE, 12..=20)].concat());
    new.bookmark = Some(bookmark(LIFE, 20));
    let mut contradicts = entry(LIFE, 12);
    contradicts.entry.changed = Inputs(1);
    new.records.push(Record::Entry(contradicts));
    archive.append(&[new]).unwrap();
    let mut other = batch(entries(LIFE, 15..=22));
    for record in &mut other.records {
        let Record::Entry(entry) = record else { unreachable!() };
        entry.life = NEXT_LIFE;
    }
    (other.collector, other.joins) = ("control room".to_owned(), true);
    archive.append(&[other]).unwrap();
    let keep = Keep { since: Some(at_s(-1000)), bytes: None };
    assert_eq!(archive.expire(keep, at_s(10)).unwrap().entries, 6);
    archive.set_outlet("plant database", 7).unwrap();
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What is added gives the same digests as then. The file of a new schema is one that this makes.
#[test]
fn the_same_records_give_the_same_heads_as_ever() {
    let home = Home::new();
    let mut archive = home.open();
    fill(&mut archive);
    let heads: Vec<String> =
        archive.heads().unwrap().iter().map(|head| hex(&head.digest)).collect();
    assert_eq!(heads, HEADS_1);
}

#[test]
fn a_file_of_each_schema_is_read_and_written_on() {
    for (name, heads) in FILES {
        let home = Home::new();
        let stored = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/past").join(name);
        std::fs::copy(stored, home.path()).unwrap();
        for access in [Access::Read, Access::Write { program: PROGRAM }] {
            let mut archive = home.open_for(access).unwrap();
            let found: Vec<String> =
                archive.heads().unwrap().iter().map(|head| hex(&head.digest)).collect();
            assert_eq!(found, heads, "{name}");
            assert!(archive.verify().unwrap().1.is_empty(), "{name}");
            let all = everything(&mut archive, "U1-SER1");
            let entries = all.iter().filter(|record| matches!(record, Record::Entry(_)));
            assert_eq!(entries.count(), 16, "6 to 9, 12 to 22, and one that contradicts");
            assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(LIFE, 20)));
            assert_eq!(archive.outlet("plant database").unwrap(), 7);
            let check = archive.check().unwrap();
            let found = &check.recorders[0];
            assert_eq!((found.conflicts, found.expired_conflicts), (1, 1));
        }
        let mut archive = home.open();
        let appended = archive.append(&[batch(entries(LIFE, 20..=25))]).unwrap()[0];
        assert_eq!((appended.entries, appended.known), (3, 3), "{name}");
        assert!(archive.verify().unwrap().1.is_empty(), "{name}");
    }
}

/// An archive that was made with a migration never sees another one of that name.
#[test]
fn a_migration_is_never_changed() {
    for (text, digest) in [
        (
            include_str!("../migrations/sqlite/0001_first.sql"),
            "b11513b9242c8e99fa677f4d2dbad583534ea2e1b7c290823aa495fa9631c559",
        ),
        (
            include_str!("../migrations/postgres/0001_first.sql"),
            "ddf155830be866d94f36e5f890f89ce52b09047da122a2985bde424d9cab282a",
        ),
    ] {
        assert_eq!(hex(&Sha256::digest(text)), digest);
    }
}
