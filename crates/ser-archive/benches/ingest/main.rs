//! How fast entries go into an archive, beside what the databases' own tools do with the same rows.
//!
//! `cargo bench -p ser-archive --bench ingest` puts a million entries of thirty-two recorders into
//! a file, in batches as a collector makes them, and lets `sqlite3 .import` read the same rows into
//! a table of the same shape. With `--features postgres` and `-- --postgres ADDRESS` it does the
//! same in a database, beside `COPY`. Run as a test, it does so with a few thousand and compares
//! how many are there. The rivals reckon no digest, look for no conflict and keep no bookmark.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use clap::Parser;
use ser_archive::{Access, Archive, Batch, Bookmark, Place};
use ser_evidence::record::{EntryRecord, Life, Record};
use ser_evidence::time::{Moment, stamp};
use ser_proto::{Entry, Inputs};

#[derive(Debug, Parser)]
struct Arguments {
    /// Entries of all recorders together.
    #[arg(long, default_value_t = 1_000_000)]
    entries: u64,

    /// Entries in a batch.
    #[arg(long, default_value_t = 2000)]
    batch: u64,

    /// How often each is run.
    #[arg(long, default_value_t = 3)]
    repetitions: usize,

    /// A database that may be filled, `postgres://…`. The schema `ser_archive` there is dropped.
    #[arg(long)]
    postgres: Option<Place>,

    /// Passed by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const RECORDERS: u64 = 32;

/// How many entries are enough to see that it works.
const FEW: u64 = 6400;

/// 2026-10-01T00:00:00.
const BEGIN_US: i64 = 1_790_812_800_000_000;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let (entries, repetitions) =
        if arguments.bench { (arguments.entries, arguments.repetitions) } else { (FEW, 1) };
    let folder = tempfile::Builder::new().prefix("ingest-").tempdir()?;
    println!("{entries} entries of {RECORDERS} recorders, {repetitions} runs each");
    let rows = folder.path().join("rows.csv");
    fs::write(&rows, csv(entries)?)?;
    for _ in 0..repetitions {
        let file = folder.path().join("plant.db");
        timed("archive in a file", entries, || {
            fill(&Place::File(file.clone()), entries, arguments.batch)
        })?;
        ours_is_whole(&Place::File(file.clone()), entries)?;
        let theirs = folder.path().join("theirs.db");
        timed("sqlite3 .import", entries, || sqlite_import(&theirs, &rows))?;
        for file in fs::read_dir(folder.path())? {
            let path = file?.path();
            if path != rows {
                fs::remove_file(path)?;
            }
        }
        if let Some(place) = &arguments.postgres {
            psql(place, "DROP SCHEMA IF EXISTS ser_archive CASCADE")?;
            timed("archive in PostgreSQL", entries, || fill(place, entries, arguments.batch))?;
            ours_is_whole(place, entries)?;
            psql(place, "DROP TABLE IF EXISTS theirs")?;
            psql(place, &table("theirs", "bigint"))?;
            let copy = format!("\\copy theirs from '{}' with (format csv)", rows.display());
            timed("COPY", entries, || psql(place, &copy))?;
            psql(place, "DROP TABLE theirs")?;
        }
    }
    Ok(())
}

/// Does something and prints how long it took.
fn timed(name: &str, entries: u64, act: impl FnOnce() -> Result<()>) -> Result<()> {
    let begun = Instant::now();
    act()?;
    let seconds = begun.elapsed().as_secs_f64();
    println!("{name:24} {seconds:8.2} s {:10.0} entries/s", entries as f64 / seconds);
    Ok(())
}

/// The entry of a recorder: a change each second.
fn entry(recorder: u64, sequence: u64) -> Option<EntryRecord> {
    let number = i64::try_from(sequence).ok()?;
    let time = stamp(Moment::from_us(BEGIN_US + number * 1_000_000))?;
    let input = Inputs(1 << ((sequence + recorder) % 32));
    Some(EntryRecord {
        life: Life::from_bits(recorder + 1),
        sequence: Some(sequence),
        number: u16::try_from(sequence % 2048).ok()? + 1,
        entry: Entry { time, changed: input, state: input },
        known: EntryRecord::ALL_KNOWN,
    })
}

fn fill(place: &Place, entries: u64, batch: u64) -> Result<()> {
    let mut archive = Archive::open(place, Access::Write { program: "a benchmark" })?;
    let each = entries / RECORDERS;
    for first in (1..=each).step_by(usize::try_from(batch)?) {
        let last = each.min(first + batch - 1);
        for recorder in 0..RECORDERS {
            let records: Vec<Record> = (first..=last)
                .filter_map(|sequence| entry(recorder, sequence).map(Record::Entry))
                .collect();
            let life = Life::from_bits(recorder + 1);
            let anchor = entry(recorder, last).map(|entry| entry.entry);
            archive.append(&[Batch {
                collector: "a benchmark".to_owned(),
                recorder: format!("SER{recorder}"),
                records,
                bookmark: Some(Bookmark {
                    life,
                    sequence: last,
                    is_exact: true,
                    anchor,
                    log_size: None,
                    log: None,
                }),
                joins: false,
                at: Moment::from_us(BEGIN_US),
            }])?;
        }
    }
    Ok(())
}

fn ours_is_whole(place: &Place, entries: u64) -> Result<()> {
    let mut archive = Archive::open(place, Access::Read)?;
    let (check, (_, broken)) = (archive.check()?, archive.verify()?);
    let there: u64 = check.recorders.iter().map(|found| found.entries).sum();
    if there == entries / RECORDERS * RECORDERS && check.is_sound() && broken.is_empty() {
        return Ok(());
    }
    Err(format!("{there} of {entries} are there; {broken:?}").into())
}

/// The columns of our table of entries, with the same indexes.
fn table(name: &str, integer: &str) -> String {
    format!(
        "CREATE TABLE {name} (position {integer} PRIMARY KEY, chain {integer}, \
         recorder {integer}, life {integer}, sequence {integer}, number {integer}, \
         stamp {integer}, shown_us {integer}, changed {integer}, state {integer}, \
         known {integer}); \
         CREATE UNIQUE INDEX {name}_by_place ON {name} (recorder, life, sequence); \
         CREATE INDEX {name}_by_shown ON {name} (recorder, shown_us);"
    )
}

/// The rows as a file, in the order in which we add them.
fn csv(entries: u64) -> Result<String> {
    let mut text = String::new();
    let mut position = 0;
    for sequence in 1..=entries / RECORDERS {
        for recorder in 0..RECORDERS {
            position += 1;
            let Some(entry) = entry(recorder, sequence) else { continue };
            let shown_us = BEGIN_US + i64::try_from(sequence)? * 1_000_000;
            let (life, number, changed) = (recorder + 1, entry.number, entry.entry.changed.0);
            writeln!(
                text,
                "{position},{life},{life},{life},{sequence},{number},{shown_us},{shown_us},\
                 {changed},{changed},4294967295"
            )?;
        }
    }
    Ok(text)
}

fn sqlite_import(file: &Path, rows: &Path) -> Result<()> {
    let script = format!(
        "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; {}\n.mode csv\n.import '{}' theirs\n",
        table("theirs", "INTEGER"),
        rows.display()
    );
    let mut child = Command::new("sqlite3")
        .arg(file)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|error| format!("NOT COMPARED with sqlite3: {error}"))?;
    if let Some(mut stdin) = child.stdin.take() {
        std::io::Write::write_all(&mut stdin, script.as_bytes())?;
    }
    if child.wait()?.success() { Ok(()) } else { Err("sqlite3 failed".into()) }
}

fn psql(place: &Place, sql: &str) -> Result<()> {
    let mut command = Command::new("psql");
    command.args(["--no-psqlrc", "--quiet", "--set", "ON_ERROR_STOP=1", "--command", sql]);
    if command.arg(place.to_string()).status()?.success() {
        Ok(())
    } else {
        Err("psql failed".into())
    }
}
