//! What people are told of an import: all on standard error.

use std::path::Path;

use ser_files::import::{Imported, Note, Read};

use crate::error::{inform, warn};
use crate::site_file::counted;

/// Lines that are told one by one; further ones are only counted.
const TOLD: usize = 10;

/// What was read of a file.
pub(super) fn file(path: &Path, read: &Read) {
    let name = path.display();
    inform(format_args!("{name}: {}", read.format));
    for note in &read.notes.remarks {
        inform(format_args!("{name}: {note}"));
    }
    if let Some(extent) = read.extent.filter(|extent| extent.analog_channels > 0) {
        let channels = count(extent.analog_channels, "analog channel");
        inform(format_args!("{name}: {channels} passed over"));
    }
    left_out(&format!("{name}: "), &read.notes.left_out, read.notes.left_out_count);
    lost(&format!("{name}: "), &read.notes.lost, read.notes.lost_count);
}

/// What all files became.
pub(super) fn all(imported: &Imported, lines: u64) {
    for note in &imported.notes.remarks {
        inform(note);
    }
    left_out("", &imported.notes.left_out, imported.notes.left_out_count);
    for recorder in &imported.recorders {
        let (events, points) = (as_usize(recorder.entries), as_usize(recorder.points));
        let names = match points {
            0 => String::new(),
            points => format!(", {}", count(points, "point")),
        };
        inform(format_args!("{}: {}{names}", recorder.name, count(events, "event")));
    }
    if lines > 0 {
        warn(format_args!("{} not understood", count(as_usize(lines), "line")));
    }
}

fn left_out(name: &str, notes: &[Note], all: u64) {
    for note in notes.iter().take(TOLD) {
        warn(format_args!("{name}{note}; left out"));
    }
    let more = all.saturating_sub(u64::try_from(notes.len().min(TOLD)).unwrap_or(u64::MAX));
    if more > 0 {
        warn(format_args!("{name}{more} more left out"));
    }
}

/// Places where the file itself shows that something is missing.
fn lost(name: &str, notes: &[Note], all: u64) {
    for note in notes.iter().take(TOLD) {
        warn(format_args!("{name}{note}"));
    }
    let more = all.saturating_sub(u64::try_from(notes.len().min(TOLD)).unwrap_or(u64::MAX));
    if more > 0 {
        warn(format_args!("{name}something is missing at {}", count(as_usize(more), "more place")));
    }
}

fn count(count: usize, what: &str) -> String {
    counted(count, what).unwrap_or_else(|| format!("no {what}s"))
}

fn as_usize(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}
