//! What is added is there, once, and given back as it was.

mod common;

use common::*;
use proptest::prelude::*;
use ser_archive::{Access, Archive, Error, Window};
use ser_evidence::record::{Life, Record};
use ser_evidence::time::shown;
use ser_proto::{Inputs, TimeStamp};

#[test]
fn what_was_added_is_given_back_and_added_again_changes_nothing() {
    let home = Home::new();
    let mut archive = home.open();
    let known = vec![life(LIFE), observed(LIFE, 3), gap(LIFE, 5, 2), watched(LIFE, 9)];
    let records = [known.clone(), entries(LIFE, [1, 2, 3, 4, 5, 8, 9])].concat();
    let appended = archive.append(&[batch(records.clone())]).unwrap();
    assert_eq!((appended.entries, appended.evidence, appended.known), (7, 4, 0));
    assert_eq!(everything(&mut archive, "U1-SER1"), records);
    assert_eq!(in_order(&mut archive), records);

    let again = archive.append(&[batch(records.clone())]).unwrap();
    assert_eq!((again.entries, again.evidence, again.known), (0, 0, 11));
    assert_eq!(again.position, appended.position);
    drop(archive);
    let mut archive = Archive::open(&home.path(), Access::Read).unwrap();
    assert_eq!(everything(&mut archive, "U1-SER1"), records);
    assert!(everything(&mut archive, "U1-SER2").is_empty());
    assert_eq!(archive.recorders().unwrap(), ["U1-SER1"]);
}

#[test]
fn two_collectors_that_read_the_same_add_it_once() {
    let home = Home::new();
    let (mut one, mut other) = (home.open(), home.open());
    one.append(&[batch(entries(LIFE, 1..=5))]).unwrap();
    let mut late = batch(entries(LIFE, 3..=7));
    late.collector = "control room".to_owned();
    let appended = other.append(&[late]).unwrap();
    assert_eq!((appended.entries, appended.known, appended.conflicts), (2, 3, 0));
    assert_eq!(everything(&mut one, "U1-SER1"), entries(LIFE, 1..=7));
}

#[test]
fn another_content_at_the_same_place_is_kept_beside_it() {
    let home = Home::new();
    let mut archive = home.open();
    let mut other = entry(LIFE, 2);
    other.entry.state = Inputs(0);
    let (first, other) = (entries(LIFE, 1..=3), vec![Record::Entry(other)]);
    archive.append(&[batch(first.clone())]).unwrap();
    for conflicts in [1, 0] {
        let appended = archive.append(&[batch(other.clone())]).unwrap();
        assert_eq!((appended.entries, appended.conflicts), (0, conflicts));
    }
    assert_eq!(everything(&mut archive, "U1-SER1"), [first, other].concat());
    let check = archive.check().unwrap();
    assert_eq!(check.recorders[0].conflicts, 1);
    assert!(!check.is_sound());
}

#[test]
fn a_conflict_within_one_batch_is_one_too() {
    let home = Home::new();
    let mut archive = home.open();
    let mut other = entry(LIFE, 1);
    other.entry.changed = Inputs(4);
    let records = vec![Record::Entry(entry(LIFE, 1)), Record::Entry(other)];
    let appended = archive.append(&[batch([records.clone(), records].concat())]).unwrap();
    assert_eq!((appended.entries, appended.conflicts, appended.known), (1, 1, 2));
}

#[test]
fn the_number_in_the_ring_is_no_part_of_what_an_entry_is() {
    let home = Home::new();
    let mut archive = home.open();
    let mut resized = entry(LIFE, 1);
    resized.number = 700;
    archive.append(&[batch(entries(LIFE, [1]))]).unwrap();
    assert_eq!(archive.append(&[batch(vec![Record::Entry(resized)])]).unwrap().known, 1);
}

#[test]
fn a_bookmark_moves_with_what_was_read_or_not_at_all() {
    let home = Home::new();
    let mut archive = home.open();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), None);
    let mut good = batch(entries(LIFE, 1..=5));
    good.bookmark = Some(bookmark(LIFE, 5));
    archive.append(&[good]).unwrap();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(LIFE, 5)));
    assert_eq!(archive.bookmark("control room", "U1-SER1").unwrap(), None);

    let mut nowhere = entry(LIFE, 7);
    nowhere.sequence = None;
    let mut bad = batch(vec![Record::Entry(entry(LIFE, 6)), Record::Entry(nowhere)]);
    bad.bookmark = Some(bookmark(LIFE, 7));
    let mut fine = batch(entries(NEXT_LIFE, [1]));
    fine.recorder = "U1-SER2".to_owned();
    let error = archive.append(&[fine, bad]).unwrap_err();
    assert!(matches!(error, Error::NoPlace { .. }), "{error}");
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(LIFE, 5)));
    assert_eq!(everything(&mut archive, "U1-SER1"), entries(LIFE, 1..=5));
    assert_eq!(archive.recorders().unwrap(), ["U1-SER1"]);

    let mut empty = batch(Vec::new());
    empty.bookmark = Some(bookmark(NEXT_LIFE, 0));
    let position = archive.position().unwrap();
    archive.append(&[empty]).unwrap();
    assert_eq!(archive.bookmark("cellar", "U1-SER1").unwrap(), Some(bookmark(NEXT_LIFE, 0)));
    assert_eq!(archive.position().unwrap(), position);
}

#[test]
fn a_window_is_by_what_the_recorder_showed_and_an_impossible_stamp_is_in_each() {
    let home = Home::new();
    let mut archive = home.open();
    let mut impossible = entry(LIFE, 4);
    impossible.entry.time = TimeStamp { month: 13, ..impossible.entry.time };
    let impossible = Record::Entry(impossible);
    let records = [entries(LIFE, 1..=3), vec![impossible.clone()], entries(LIFE, 5..=9)].concat();
    archive.append(&[batch(records)]).unwrap();
    let moment = |sequence| shown(&entry(LIFE, sequence).entry.time);
    let window = |from: Option<u64>, until: Option<u64>| Window {
        from: from.and_then(moment),
        until: until.and_then(moment),
    };
    let mut read = |window| {
        let mut found = Vec::new();
        archive
            .read("U1-SER1", window, &mut |record| {
                found.push(record.clone());
                Ok(())
            })
            .unwrap();
        found
    };
    let with = |before, after| [before, vec![impossible.clone()], after].concat();
    assert_eq!(read(window(Some(6), Some(7))), with(vec![], entries(LIFE, 6..=7)));
    assert_eq!(read(window(None, Some(2))), with(entries(LIFE, 1..=2), vec![]));
    assert_eq!(read(window(Some(8), None)), with(vec![], entries(LIFE, 8..=9)));
}

#[test]
fn a_life_is_found_by_an_entry_of_it() {
    let home = Home::new();
    let mut archive = home.open();
    let far = 3 * 65_536 + 7;
    archive.append(&[batch(entries(LIFE, [1, 2, far]))]).unwrap();
    let mut life_of = |sequence, entry| archive.life_of("U1-SER1", sequence, &entry).unwrap();
    assert_eq!(life_of(2, entry(LIFE, 2).entry), Some((LIFE, 2)));
    assert_eq!(life_of(7, entry(LIFE, far).entry), Some((LIFE, far)));
    assert_eq!(life_of(3, entry(LIFE, 2).entry), None);
    assert_eq!(life_of(2, entry(LIFE, 1).entry), None);
}

#[test]
fn only_an_archive_of_ours_is_opened_and_nothing_else_is_touched() {
    let home = Home::new();
    let write = Access::Write { program: PROGRAM };
    let refused = |access| Archive::open(&home.path(), access).err().expect("refused");
    assert!(matches!(refused(Access::Read), Error::Missing { .. }));
    assert!(!home.path().exists());
    for content in
        [&b"a letter to the operator, long enough to be no empty file"[..], b"SQLite format 3\0"]
    {
        std::fs::write(home.path(), content).unwrap();
        for access in [Access::Read, write] {
            let error = refused(access);
            assert!(matches!(error, Error::NotOurs { .. }), "{error:?}");
            assert_eq!(std::fs::read(home.path()).unwrap(), content);
        }
    }
    std::fs::remove_file(home.path()).unwrap();
    home.raw().execute_batch("CREATE TABLE theirs (a); INSERT INTO theirs VALUES (1);").unwrap();
    let before = std::fs::read(home.path()).unwrap();
    for access in [Access::Read, write] {
        assert!(matches!(refused(access), Error::NotOurs { .. }));
        assert_eq!(std::fs::read(home.path()).unwrap(), before);
    }
}

#[test]
fn an_archive_of_a_newer_program_is_refused_by_name() {
    let home = Home::new();
    home.open().append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let set = |column: &str, value: i64| {
        let change = format!("UPDATE archive SET {column} = {value}, program = 'ser-cli 9.0.0'");
        home.raw().execute(&change, ()).unwrap();
    };
    set("schema", 1000);
    let error = Archive::open(&home.path(), Access::Write { program: PROGRAM }).err().unwrap();
    let text = error.to_string();
    assert!(text.contains("ser-cli 9.0.0") && text.contains("schema 1000"), "{text}");
    let mut archive = Archive::open(&home.path(), Access::Read).unwrap();
    assert_eq!(everything(&mut archive, "U1-SER1").len(), 3);
    assert!(archive.append(&[batch(entries(LIFE, [4]))]).is_err(), "it was opened to read");
    set("readable_by", 1000);
    assert!(matches!(Archive::open(&home.path(), Access::Read), Err(Error::Newer { .. })));
}

#[test]
fn a_backup_is_whole_and_takes_nobodys_place() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=500))]).unwrap();
    let copy = home.beside("copy.db");
    archive.back_up(&copy).unwrap();
    archive.append(&[batch(entries(LIFE, [501]))]).unwrap();
    assert!(archive.back_up(&copy).is_err(), "there is one");
    let mut copied = Archive::open(&copy, Access::Read).unwrap();
    assert_eq!(everything(&mut copied, "U1-SER1"), entries(LIFE, 1..=500));
    assert!(copied.verify().unwrap().1.is_empty());
    let names: Vec<_> = std::fs::read_dir(copy.parent().unwrap())
        .unwrap()
        .map(|file| file.unwrap().file_name())
        .collect();
    assert!(
        names.iter().all(|name| {
            let name = name.to_string_lossy();
            name.starts_with("plant.db") || name.starts_with("copy.db")
        }),
        "{names:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is added in whatever pieces, each entry is there once, as it was read.
    #[test]
    fn pieces_in_any_order_give_the_same_archive(
        pieces in prop::collection::vec(
            (prop::sample::select(vec![LIFE, NEXT_LIFE]), 0_u64..40, 0_u64..10),
            1..12,
        ),
    ) {
        let home = Home::new();
        let mut archive = home.open();
        let mut expected = std::collections::BTreeSet::new();
        for (life, first, count) in pieces {
            let sequences = first + 1..first + 1 + count;
            expected.extend(sequences.clone().map(|sequence| (life, sequence)));
            archive.append(&[batch(entries(life, sequences))]).unwrap();
        }
        // By the name of the life as a number with a sign.
        let mut expected: Vec<(Life, u64)> = expected.into_iter().collect();
        expected.sort_by_key(|(life, sequence)| (life.bits().cast_signed(), *sequence));
        let expected: Vec<Record> =
            expected.into_iter().map(|(life, at)| Record::Entry(entry(life, at))).collect();
        prop_assert_eq!(everything(&mut archive, "U1-SER1"), expected);
        prop_assert!(archive.verify().unwrap().1.is_empty());
    }
}
