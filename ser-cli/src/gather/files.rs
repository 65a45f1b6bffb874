//! Reads files that were written before.

use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::thread;

use ser_evidence::history::Collector;
use ser_evidence::record::{EntryRecord, Gap, Lost, Record, Why};
use ser_evidence::site::{Recorder, Site};
use ser_files::Source;

use crate::error::{Failure, Result, advise, warn};
use crate::unit_name::UnitName;

/// How many files are read at a time.
const AT_ONCE: usize = 4;

/// Damaged lines of a file that are told one by one; further ones are only counted.
const TOLD: u64 = 3;

/// How much of a file is read at a time.
const BUFFER: usize = 1 << 18;

/// Reads all files. Damaged lines are told and passed over; returns how many there were.
///
/// A file that was read without the site file calls its recorder by the port. Where the site has that
/// port, the recorder gets its name.
pub(super) fn read(files: &[PathBuf], site: &Site, collector: &mut Collector) -> Result<u64> {
    let names = names_by_port(site);
    let waiting = Mutex::new(files.iter());
    let next = || waiting.lock().map_or(None, |mut waiting| waiting.next());
    let work = || -> Result<(Collector, u64)> {
        let mut own = Collector::new();
        let mut damaged = 0;
        while let Some(path) = next() {
            damaged += read_one(path, &names, &mut own)?;
        }
        Ok((own, damaged))
    };
    let workers = thread::available_parallelism().map_or(1, usize::from).min(AT_ONCE);
    let results: Vec<Result<(Collector, u64)>> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers.min(files.len())).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    let mut damaged = 0;
    for result in results {
        let (own, lines) = result?;
        collector.merge(own);
        damaged += lines;
    }
    Ok(damaged)
}

fn read_one(path: &Path, names: &Names, collector: &mut Collector) -> Result<u64> {
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
    let mut source = Source::new(input, &recorder_of(path)).map_err(|error| failed(&error))?;
    collector.begin_source();
    let mut damaged = 0;
    let (mut last, mut last_of) = (None, String::new());
    while let Some(record) = source.read() {
        let told = source.recorder();
        let recorder = names.get(told).map_or(told, String::as_str);
        if last_of != recorder {
            (last, last_of) = (None, recorder.to_owned());
        }
        match record {
            Ok(record) => {
                if let Record::Entry(EntryRecord { life, sequence, .. }) = record {
                    last = Some((life, sequence));
                }
                collector.add(recorder, &record);
            }
            Err(error) if error.is_of_one_line() => {
                damaged += 1;
                // The line may have been the next entry of the same log.
                if let Some((life, after)) = last {
                    let (lost, why) = (Lost::Unknown, Why::Unreadable);
                    collector.add(recorder, &Record::Gap(Gap { life, after, lost, why }));
                }
                if damaged <= TOLD {
                    warn(format_args!("{}: {error}; the line is left out", path.display()));
                }
            }
            Err(error) => return Err(failed(&error)),
        }
    }
    if damaged > TOLD {
        warn(format_args!("{}: {} more damaged lines", path.display(), damaged - TOLD));
    }
    if damaged > 0 {
        advise(
            "entries may be missing because of that: read the recorder again if it still has them",
        );
    }
    Ok(damaged)
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
