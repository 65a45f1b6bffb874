//! Events on standard output: as a table, as CSV or as JSON lines.

mod csv;
mod elapsed;
mod jsonl;
mod palette;
mod sequence;
mod table;

use std::fs::File;
use std::io::{self, BufWriter, Write};

use clap::ValueEnum;
use ser_proto::Entry;

pub(crate) use csv::Csv;
pub(crate) use elapsed::Elapsed;
pub(crate) use jsonl::JsonLines;
pub(crate) use palette::Palette;
pub(crate) use sequence::{PointNames, Sequence};
pub(crate) use table::Table;

/// How events are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people: with the time since the previous and since the first event.
    #[default]
    Table,
    /// One row per input that changed: entry,time,input,state.
    Csv,
    /// One JSON object per event: entry, time, changed, state.
    Jsonl,
}

/// Takes events in the order in which they happened.
pub(crate) trait EventWriter {
    /// Writes the event that the unit has under entry `number`.
    fn event(&mut self, number: u16, entry: &Entry) -> io::Result<()>;

    /// Marks the place of lost events, in formats for people. Programs get data only.
    fn lost(&mut self, what: &str) -> io::Result<()>;

    /// Passes on what has been written so far.
    fn flush(&mut self) -> io::Result<()>;
}

/// The writer of `format` on standard output.
pub(crate) fn to_stdout(format: Format) -> Box<dyn EventWriter> {
    let out = BufWriter::new(io::stdout());
    match format {
        Format::Table => Box::new(Table::new(out, Palette::of_stdout())),
        Format::Csv => Box::new(Csv::new(out)),
        Format::Jsonl => Box::new(JsonLines::new(out)),
    }
}

/// Sees to it that what was written to standard output is on the disk, if it is a file there.
pub(crate) fn sync_stdout() {
    if let Ok(file) = stdout_file() {
        // Terminals and pipes cannot, and need not, do this.
        let _ = file.sync_data();
    }
}

#[cfg(unix)]
fn stdout_file() -> io::Result<File> {
    use std::os::fd::AsFd;
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

#[cfg(windows)]
fn stdout_file() -> io::Result<File> {
    use std::os::windows::io::AsHandle;
    Ok(File::from(io::stdout().as_handle().try_clone_to_owned()?))
}

#[cfg(not(any(unix, windows)))]
fn stdout_file() -> io::Result<File> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Writes `name` and what it is in two columns, as `status` and `config` do.
pub(crate) fn field(out: &mut dyn Write, name: &str, value: impl std::fmt::Display) -> io::Result<()> {
    writeln!(out, "{name:<16}{value}")
}

#[cfg(test)]
pub(crate) mod testing {
    //! Events that every writer is tested with.

    use ser_proto::{Entry, Inputs};

    use crate::time::parse_time;

    /// An event at 10:00 plus `time`, given as `00.250`.
    pub(crate) fn entry(time: &str, changed: &[u8], state: &[u8]) -> Entry {
        let set = |numbers: &[u8]| Inputs(numbers.iter().fold(0, |bits, number| bits | 1 << (number - 1)));
        Entry {
            changed: set(changed),
            state: set(state),
            time: parse_time(&format!("2026-11-22T10:00:{time}")).expect("a time"),
        }
    }
}
