//! What only files have: other programs' files, backups, and everybody's access to every byte.

mod common;
mod judge;

use std::path::Path;

use common::*;
use proptest::prelude::*;
use rusqlite::types::Value;
use ser_archive::{Access, Archive, Error, Keep, Place, Writer};
use ser_evidence::record::{Life, Record};

fn open_copy(path: &Path) -> ser_archive::Result<Archive> {
    Archive::open(&Place::File(path.to_owned()), Access::Read)
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
fn only_an_archive_of_ours_is_opened_and_nothing_else_is_touched() {
    let home = Home::new();
    let write = Access::Write { program: PROGRAM };
    let refused = |access| home.open_for(access).err().expect("refused");
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
fn a_backup_is_whole_and_takes_nobodys_place() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=500))]).unwrap();
    let copy = home.beside("copy.db");
    archive.back_up(&copy).unwrap();
    archive.append(&[batch(entries(LIFE, [501]))]).unwrap();
    assert!(archive.back_up(&copy).is_err(), "there is one");
    let mut copied = open_copy(&copy).unwrap();
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

#[test]
fn a_backup_is_made_while_others_write_all_the_time() {
    let home = Home::new();
    let mut archive = home.open();
    for number in 0..40 {
        let first = number * 10_000 + 1;
        archive.append(&[batch(entries(LIFE, first..first + 10_000))]).unwrap();
    }
    let is_over = std::sync::atomic::AtomicBool::new(false);
    let order = std::sync::atomic::Ordering::Relaxed;
    let mut other = home.open();
    let commits = std::thread::scope(|scope| {
        let writer = scope.spawn(|| {
            let sequences = (1..100_000).take_while(|_| !is_over.load(order));
            sequences.map(|at| other.append(&[batch(entries(NEXT_LIFE, [at]))]).unwrap()).count()
        });
        archive.back_up(&home.beside("copy.db")).unwrap();
        is_over.store(true, order);
        writer.join().unwrap()
    });
    assert!(commits < 2000, "{commits} commits");
    assert_eq!(open_copy(&home.beside("copy.db")).unwrap().verify().unwrap().1, []);
}

#[test]
fn who_reads_changes_no_byte() {
    let home = Home::new();
    let mut archive = home.open();
    archive.append(&[batch(entries(LIFE, 1..=100))]).unwrap();
    // As a crash leaves them.
    let folder = tempfile::tempdir().unwrap();
    let names = ["plant.db", "plant.db-wal"];
    for name in names {
        std::fs::copy(home.beside(name), folder.path().join(name)).unwrap();
    }
    let bytes = || names.map(|name| std::fs::read(folder.path().join(name)).unwrap());
    let before = bytes();
    let mut left = open_copy(&folder.path().join("plant.db")).unwrap();
    assert_eq!(everything(&mut left, "U1-SER1"), entries(LIFE, 1..=100));
    drop(left);
    assert!(bytes() == before);
}

#[test]
fn a_file_in_which_somebody_has_put_statements_is_refused() {
    for put in [
        "CREATE TRIGGER taken BEFORE INSERT ON entry BEGIN SELECT RAISE(IGNORE); END",
        "ALTER TABLE entry RENAME TO theirs; CREATE VIEW entry AS WITH RECURSIVE counted (n) AS \
         (SELECT 1 UNION ALL SELECT n + 1 FROM counted) SELECT theirs.* FROM counted, theirs",
        "ALTER TABLE evidence ADD COLUMN large TEXT AS (hex(zeroblob(400000000)))",
    ] {
        let home = Home::new();
        home.open().append(&[batch(vec![life(LIFE)])]).unwrap();
        home.sql(put);
        for access in [Access::Read, Access::Write { program: PROGRAM }] {
            let error = home.open_for(access).err().expect(put);
            assert!(matches!(error, Error::Damaged { .. }), "{error:?}");
        }
    }
}

#[test]
fn who_has_waited_long_enough_for_another_program_is_told_so() {
    let home = Home::new();
    let place = home.place();
    let open = move || {
        let mut archive = Archive::open(&place, Access::Write { program: PROGRAM })?;
        archive.set_patience(std::time::Duration::from_millis(20))?;
        Ok(archive)
    };
    let writer = Writer::start(open, 16).unwrap();
    writer.with(Archive::position).unwrap();
    let raw = home.raw();
    raw.execute_batch("BEGIN IMMEDIATE").unwrap();
    let tickets: Vec<_> =
        (1..=6).map(|at| writer.append(batch(entries(LIFE, [at]))).unwrap()).collect();
    for ticket in tickets {
        assert!(matches!(ticket.wait(), Err(Error::Busy { .. })));
    }
    raw.execute_batch("COMMIT").unwrap();
    writer.append(batch(entries(LIFE, [1]))).unwrap().wait().unwrap();
}

#[test]
fn a_name_is_that_of_a_file_whatever_it_is() {
    // Nothing else in this program changes the folder.
    let folder = tempfile::tempdir().unwrap();
    std::env::set_current_dir(folder.path()).unwrap();
    for name in [":memory:", "file:plant.db?mode=memory"] {
        let place = Place::File(name.into());
        let write = Access::Write { program: PROGRAM };
        Archive::open(&place, write).unwrap().append(&[batch(entries(LIFE, [1]))]).unwrap();
        assert_eq!(Archive::open(&place, Access::Read).unwrap().position().unwrap(), 1);
        assert!(folder.path().join(name).exists());
    }
    assert!(Archive::open(&Place::File("".into()), Access::Write { program: PROGRAM }).is_err());
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
            // A link's time is not a part of the chain, nor are positions: only the order of rows
            // is.
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
            let mut tried = open_copy(&copy).unwrap();
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

/// Each finds no archive, or the whole one.
#[test]
fn programs_that_make_the_same_archive_at_once_all_have_it() {
    const PROGRAMS: usize = 6;
    for _ in 0..20 {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("plant.db"));
        let together = std::sync::Barrier::new(PROGRAMS);
        std::thread::scope(|scope| {
            for _ in 0..PROGRAMS {
                scope.spawn(|| {
                    together.wait();
                    let made = Archive::open(&place, Access::Write { program: "a test" });
                    assert_eq!(made.and_then(|mut archive| archive.position()).unwrap(), 0);
                });
            }
        });
    }
}
