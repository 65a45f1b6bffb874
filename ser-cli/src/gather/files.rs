//! Reads files that were written before.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::thread;

use ser_evidence::history::Collector;
use ser_evidence::record::{Gap, Record, Why};
use ser_evidence::site::{Recorder, Site};
use ser_files::import::is_doubt_of_time;
use ser_files::{Problem, Source};

use crate::error::{Failure, Result, advise, warn};
use crate::unit_name::UnitName;

/// How many files are read at a time.
const AT_ONCE: usize = 4;

/// Damaged lines of a file that are told one by one; further ones are only counted.
const TOLD: u64 = 3;

/// How much of a file is read at a time.
const BUFFER: usize = 1 << 18;

/// Lines that could not be read.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Damaged {
    /// How many.
    pub(crate) lines: u64,
    /// How many of them are no loss at a place of a log, because nobody knows the place.
    pub(crate) without_place: u64,
    /// Entries that were read and may be at either of two times.
    pub(crate) doubtful_hours: u64,
}

impl Damaged {
    fn add(&mut self, other: Damaged) {
        self.lines += other.lines;
        self.without_place += other.without_place;
        self.doubtful_hours += other.doubtful_hours;
    }
}

/// Reads all files. Damaged lines are told and passed over; returns how many there were.
///
/// A file that was read without the site file calls its recorder by the port. Where the site has that
/// port, the recorder gets its name.
pub(super) fn read(files: &[PathBuf], site: &Site, collector: &mut Collector) -> Result<Damaged> {
    let names = names_by_port(site);
    let waiting = Mutex::new(files.iter());
    let next = || waiting.lock().map_or(None, |mut waiting| waiting.next());
    let work = || -> Result<(Collector, Damaged)> {
        let mut own = Collector::new();
        let mut damaged = Damaged::default();
        while let Some(path) = next() {
            damaged.add(read_one(path, &names, &mut own)?);
        }
        Ok((own, damaged))
    };
    let workers = thread::available_parallelism().map_or(1, usize::from).min(AT_ONCE);
    let results: Vec<Result<(Collector, Damaged)>> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers.min(files.len())).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let mut damaged = Damaged::default();
    for result in results {
        let (own, lines) = result?;
        collector.merge(own);
        damaged.add(lines);
    }
    Ok(damaged)
}

fn read_one(path: &Path, names: &Names, collector: &mut Collector) -> Result<Damaged> {
    let failed = |error: &dyn std::fmt::Display| {
        Failure::new(format!("{}: {error}", path.display()))
            .hint("--input takes what ser-cli read or watch wrote with --format jsonl or csv")
    };
    let file = File::open(path).map_err(|error| Failure::reading(path.display(), &error))?;
    if file.metadata().is_ok_and(|about| about.is_dir()) {
        return Err(Failure::new(format!("{} is a folder", path.display()))
            .hint(format!("name the files in it, as in {}", path.join("*.jsonl").display())));
    }
    let input = BufReader::with_capacity(BUFFER, file);
    let mut source =
        Source::new(input, &recorder_of(path)).map_err(|error| match error.problem {
            Problem::Utf16 => failed(&error).hint(format!(
                "make it one of ours with ser-cli import {} -o {}",
                path.display(),
                path.with_extension("utf-8.jsonl").display()
            )),
            _ => failed(&error),
        })?;
    collector.begin_source();
    let (mut damaged, mut earlier, mut doubtful) = (Damaged::default(), 0, 0);
    while let Some(record) = source.read() {
        let told = source.recorder();
        let recorder = names.get(told).map_or(told, String::as_str);
        match record {
            // An import has left out a line whose place nobody knows.
            Ok(Record::Gap(Gap { after: None, why: Why::Unreadable, .. })) => {
                earlier += 1;
            }
            Ok(record) => {
                doubtful += u64::from(source.note().is_some_and(is_doubt_of_time));
                collector.add(recorder, &record);
            }
            Err(error) if error.is_of_one_line() => {
                damaged.lines += 1;
                let gap = source.damage();
                match gap.after {
                    Some(_) => collector.add(recorder, &Record::Gap(gap)),
                    None => damaged.without_place += 1,
                }
                if damaged.lines <= TOLD {
                    warn(format_args!("{}: {error}; the line is left out", path.display()));
                }
            }
            Err(error) => return Err(failed(&error)),
        }
    }
    tell_damaged(path, damaged.lines, earlier);
    tell_doubtful(path, doubtful);
    damaged.add(Damaged { lines: earlier, without_place: earlier, doubtful_hours: doubtful });
    Ok(damaged)
}

/// Tells of damaged lines beyond those that were told one by one, and of those that an import found
/// in the file that this one is made from.
fn tell_damaged(path: &Path, lines: u64, earlier: u64) {
    if lines > TOLD {
        warn(format_args!("{}: {} more damaged lines", path.display(), lines - TOLD));
    }
    if earlier > 0 {
        warn(format_args!(
            "{}: the file that it is made from has damaged lines whose place is not known: {earlier}",
            path.display()
        ));
    }
    if lines + earlier > 0 {
        advise(
            "entries may be missing because of that: read the recorder again if it still has them",
        );
    }
}

/// Tells of entries whose time may be another one by an hour, which nothing else shows.
fn tell_doubtful(path: &Path, entries: u64) {
    if entries > 0 {
        warn(format_args!(
            "{}: entries whose local hour came twice or was left out: {entries}. Each is shown at one \
             of two times, and its `note` in the file says what the other may be",
            path.display()
        ));
        advise("if that clock does not follow summer time, import the list with a fixed --zone");
    }
}

/// The names of recorders in the site, by the names of their ports.
type Names = HashMap<String, String>;

fn names_by_port(site: &Site) -> Names {
    let of_recorder = |recorder: &Recorder| {
        let port = recorder.port.as_deref()?;
        let unit = UnitName::of(port, &port.parse().ok()?);
        Some((unit.name, recorder.name.clone()))
    };
    site.recorders.iter().filter_map(of_recorder).collect()
}

/// Whose entries a file holds that does not say it: by its name.
fn recorder_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}
