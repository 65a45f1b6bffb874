//! What is missing is said, and what somebody changed is found.

mod common;

use common::*;
use rusqlite::types::Value;
use ser_archive::{Archive, Hole, Keep};
use ser_evidence::record::{Gap, Lost, Record, Why};

#[test]
fn a_number_that_is_not_there_is_a_hole_unless_it_was_told() {
    let home = Home::new();
    let mut archive = home.open();
    let records = [vec![life(LIFE), gap(LIFE, 5, 2)], entries(LIFE, [3, 4, 5, 8, 9, 12])].concat();
    archive.append(&[batch(records)]).unwrap();
    let check = archive.check().unwrap();
    let found = &check.recorders[0];
    let hole = |after, missing| Hole { life: LIFE, after, missing, told: 0 };
    assert_eq!(found.holes, [hole(0, 2), hole(9, 2)]);
    assert_eq!((found.entries, found.lives, found.told.len()), (6, 1, 1));
    archive.append(&[batch(vec![gap(LIFE, 0, 2), gap(LIFE, 9, 2)])]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

#[test]
fn what_was_watched_must_be_there() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch([vec![watched(LIFE, 5)], entries(LIFE, 1..=4)].concat())]).unwrap();
    let hole = Hole { life: LIFE, after: 4, missing: 1, told: 0 };
    assert_eq!(archive.check().unwrap().recorders[0].holes, [hole]);
    archive.append(&[batch(entries(LIFE, [5]))]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

#[test]
fn where_a_log_began_is_not_known_if_its_total_had_wrapped() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 700..=705))]).unwrap();
    assert!(archive.check().unwrap().is_sound());
}

/// An archive with rows of every kind, in which something was let go as well.
fn of_every_kind(home: &Home) -> Archive {
    let mut archive = home.open();
    for (second, sequences) in [(0, 1..=3), (10, 4..=6), (20, 7..=9)] {
        let mut batch =
            batch([vec![observed(LIFE, second + 1)], entries(LIFE, sequences)].concat());
        batch.at = at_s(second.try_into().unwrap());
        batch.bookmark = Some(bookmark(LIFE, 3));
        archive.append(&[batch]).unwrap();
    }
    let mut other = entry(LIFE, 8);
    other.entry.state.0 ^= 2;
    archive.append(&[batch(vec![Record::Entry(other), life(LIFE)])]).unwrap();
    let keep = Keep { since: Some(at_s(5)), bytes: None };
    // The clock of the computer went back at the end. What was added then is not old.
    let gone = archive.expire(keep, at_s(30)).unwrap();
    assert_eq!(gone.entries, 3);
    let again = [entries(LIFE, 10..=12), vec![observed(LIFE, 11)]].concat();
    archive.append(&[batch(again)]).unwrap();
    archive
}

#[test]
fn every_change_of_a_row_is_found() {
    let home = Home::new();
    let (heads, broken) = of_every_kind(&home).verify().unwrap();
    assert_eq!((heads.len(), broken.len()), (1, 0));
    let raw = home.raw();
    let columns = |table: &str| -> Vec<String> {
        let mut statement =
            raw.prepare(&format!("SELECT name FROM pragma_table_info('{table}')")).unwrap();
        let names = statement.query_map((), |row| row.get(0)).unwrap();
        names.map(Result::unwrap).collect()
    };
    let mut tried = 0;
    for table in ["entry", "conflict", "evidence", "link", "checkpoint", "chain"] {
        for column in columns(table) {
            // A link's time is not a part of the chain, nor are positions: only the order of rows is.
            if column == "position" || (table, column.as_str()) == ("link", "archived_us") {
                continue;
            }
            let mut rows = raw
                .prepare(&format!("SELECT rowid, {column} FROM {table}"))
                .or_else(|_| raw.prepare(&format!("SELECT position, {column} FROM {table}")))
                .unwrap();
            let rows: Vec<(i64, Value)> = rows
                .query_map((), |row| Ok((row.get(0)?, row.get(1)?)))
                .unwrap()
                .map(Result::unwrap)
                .collect();
            let key = if table == "link" { "position" } else { "rowid" };
            for (at, value) in rows {
                let changed = match &value {
                    Value::Integer(number) => Value::Integer(number ^ 1),
                    Value::Text(text) => Value::Text(format!("{text} ")),
                    Value::Blob(bytes) => {
                        let mut bytes = bytes.clone();
                        bytes[5] ^= 1;
                        Value::Blob(bytes)
                    }
                    Value::Null | Value::Real(_) => continue,
                };
                let set = format!("UPDATE {table} SET {column} = ?1 WHERE {key} = ?2");
                raw.execute_batch("PRAGMA foreign_keys = OFF; SAVEPOINT here").unwrap();
                // What the tables themselves refuse, nobody can do.
                if raw.execute(&set, (&changed, at)).is_ok() {
                    raw.execute_batch("RELEASE here").unwrap();
                    tried += 1;
                    let verified = home.open().verify();
                    let is_found = verified
                        .as_ref()
                        .map_or(true, |(now, broken)| !broken.is_empty() || *now != heads);
                    assert!(is_found, "{table}.{column} at {at}: {value:?} became {changed:?}");
                    let back = if column == "id" { changed } else { Value::Integer(at) };
                    raw.execute(&set, (&value, back)).unwrap();
                } else {
                    raw.execute_batch("ROLLBACK TO here; RELEASE here").unwrap();
                }
            }
        }
    }
    assert!(tried > 140, "{tried}");
    assert!(home.open().verify().unwrap().1.is_empty(), "all was put back");
}

#[test]
fn every_row_that_is_taken_away_or_put_in_is_found() {
    let home = Home::new();
    let (heads, _) = of_every_kind(&home).verify().unwrap();
    for table in ["entry", "conflict", "evidence", "link", "checkpoint"] {
        let count: i64 = home
            .raw()
            .query_row(&format!("SELECT count(*) FROM {table}"), (), |row| row.get(0))
            .unwrap();
        assert!(count > 0, "{table}");
        // A link is the digest at a place. Only the last one vouches for rows that no other does.
        for place in if table == "link" { count - 1..count } else { 0..count } {
            let copy = home.beside("tried.db");
            _ = std::fs::remove_file(&copy);
            home.open().back_up(&copy).unwrap();
            let raw = rusqlite::Connection::open(&copy).unwrap();
            let which =
                format!("SELECT position FROM {table} ORDER BY position LIMIT 1 OFFSET {place}");
            let position: i64 = raw.query_row(&which, (), |row| row.get(0)).unwrap();
            raw.execute(&format!("DELETE FROM {table} WHERE position = ?1"), (position,)).unwrap();
            let mut tried = Archive::open(&copy, ser_archive::Access::Read).unwrap();
            let found =
                tried.verify().map_or(true, |(now, broken)| !broken.is_empty() || now != heads);
            assert!(found, "{table} at {position}");
        }
    }
    let raw = home.raw();
    let copy_of = |table: &str, to: i64| {
        let sequence = if table == "entry" { "sequence + 1000" } else { "sequence" };
        format!(
            "INSERT INTO {table} SELECT {to}, chain, recorder, life, {sequence}, number, stamp, \
             shown_us, changed, state, known FROM entry ORDER BY position DESC LIMIT 1"
        )
    };
    let last = home.open().position().unwrap();
    for (table, to) in [("entry", last + 1), ("conflict", last + 1), ("entry", 1), ("conflict", 1)]
    {
        raw.execute(&copy_of(table, to), ()).unwrap();
        assert_eq!(home.open().verify().unwrap().1.len(), 1, "{table} at {to}");
        raw.execute(&format!("DELETE FROM {table} WHERE position = {to}"), ()).unwrap();
    }
    assert!(home.open().verify().unwrap().1.is_empty(), "all was put back");
}

#[test]
fn a_tail_that_is_taken_away_shows_in_the_head_that_was_written_down() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=3))]).unwrap();
    let middle = archive.verify().unwrap().0;
    archive.append(&[batch(entries(LIFE, 4..=6))]).unwrap();
    let end = archive.verify().unwrap().0;
    assert_ne!(middle, end);
    home.raw()
        .execute_batch("DELETE FROM entry WHERE position > 3; DELETE FROM link WHERE position > 3")
        .unwrap();
    assert_eq!(archive.verify().unwrap(), (middle, Vec::new()));
}

#[test]
fn what_is_let_go_is_told_and_the_rest_stays_proven() {
    let home = Home::new();
    let mut archive = home.open();
    for day in 0..10 {
        let first = u64::try_from(day).unwrap() * 100 + 1;
        let records = [vec![observed(LIFE, first)], entries(LIFE, first..first + 100)].concat();
        let mut batch = batch(records);
        batch.at = at_s(day * 86_400);
        archive.append(&[batch]).unwrap();
    }
    archive.append(&[batch(vec![life(LIFE)])]).unwrap();
    let mut left = 1000;
    for day in [3, 3, 7] {
        let keep = Keep { since: Some(at_s(day * 86_400)), bytes: None };
        let gone = archive.expire(keep, at_s(20 * 86_400)).unwrap();
        let now_left = 1000 - u64::try_from(day).unwrap() * 100;
        assert_eq!(gone.entries, left - now_left);
        left = now_left;
        let check = archive.check().unwrap();
        assert!(check.is_sound(), "{check:?}");
        assert_eq!(check.recorders[0].entries, left);
        let told: u64 = check.recorders[0]
            .told
            .iter()
            .map(|gap| match gap {
                Gap { lost: Lost::Exactly(count), why: Why::Expired, .. } => u64::from(*count),
                other => panic!("{other:?}"),
            })
            .sum();
        assert_eq!(told, 1000 - left);
        let (heads, broken) = archive.verify().unwrap();
        assert_eq!(broken, []);
        assert!(heads[0].expired_to.is_some());
    }
    // What is known of the clock stays.
    let clocks = everything(&mut archive, "U1-SER1")
        .into_iter()
        .filter(|record| matches!(record, Record::Clock(_)))
        .count();
    assert_eq!(clocks, 10);
    // Read again from the recorder, it does not come back unseen: the rest is as it was.
    assert_eq!(archive.append(&[batch(entries(LIFE, 900..=1000))]).unwrap().known, 101);
}

#[test]
fn all_may_be_let_go() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=50))]).unwrap();
    let keep = Keep { since: Some(at_s(1)), bytes: None };
    assert_eq!(archive.expire(keep, at_s(2)).unwrap().entries, 50);
    assert_eq!(archive.verify().unwrap().1, []);
    archive.append(&[batch(entries(LIFE, 51..=60))]).unwrap();
    assert_eq!(archive.verify().unwrap().1, []);
    assert!(archive.check().unwrap().is_sound());
}

#[test]
fn an_archive_that_is_too_large_loses_its_oldest() {
    let home = Home::new();
    let mut archive = home.open();
    for part in 0..40_u64 {
        let mut batch = batch(entries(LIFE, part * 100 + 1..=part * 100 + 100));
        batch.at = at_s(part.try_into().unwrap());
        archive.append(&[batch]).unwrap();
    }
    let keep = Keep { since: None, bytes: Some(300_000) };
    let gone = archive.expire(keep, at_s(100)).unwrap();
    let check = archive.check().unwrap();
    assert!(check.is_sound());
    assert!((500..3500).contains(&gone.entries), "{gone:?}");
    assert_eq!(check.recorders[0].entries, 4000 - gone.entries);
    let left = everything(&mut archive, "U1-SER1");
    assert_eq!(left.last(), entries(LIFE, [4000]).last());
    assert_eq!(archive.expire(keep, at_s(101)).unwrap().entries, 0);
}
