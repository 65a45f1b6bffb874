//! Files as `ser-cli read` writes them, with a seed.

use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use oorandom::Rand64;
use ser_evidence::record::{EntryRecord, Life, Record};
use ser_evidence::time::{Moment, stamp};
use ser_files::jsonl::Writer;
use ser_proto::{Entry, Inputs};

/// What is written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    /// Of all files together.
    pub(crate) entries: u64,
    pub(crate) files: u64,
    pub(crate) seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Csv,
    /// CSV without a header, as `sort` needs it.
    Rows,
    Jsonl,
}

/// Files that are there until this is dropped.
pub(crate) struct Written {
    pub(crate) paths: Vec<PathBuf>,
    pub(crate) bytes: u64,
    _folder: tempfile::TempDir,
}

/// 2026-10-01T00:00:00.
const BEGIN_US: i64 = 1_790_812_800_000_000;

/// Six weeks.
const SPAN_MS: u64 = 42 * 86_400_000;

/// An incident has half as many entries to half again as many.
const INCIDENT_ENTRIES: u64 = 50;

/// The entries of one life, until the log is erased.
const LIFE_ENTRIES: u64 = 100_000;

/// The places of a log.
const LOG_SIZE: u64 = 2048;

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Format::Csv => "CSV",
            Format::Rows => "rows",
            Format::Jsonl => "JSON lines",
        })
    }
}

/// Writes all files into a folder of their own.
pub(crate) fn write(folder: &Path, plan: Plan, format: Format) -> io::Result<Written> {
    let folder = tempfile::tempdir_in(folder)?;
    let mut paths = Vec::new();
    let mut bytes = 0;
    for file in 0..plan.files {
        let recorder = format!("U{:02}-SER1", file + 1);
        let extension = if format == Format::Jsonl { "jsonl" } else { "csv" };
        let path = folder.path().join(format!("{recorder}.{extension}"));
        let mut out = BufWriter::with_capacity(1 << 18, File::create_new(&path)?);
        let entries = entries(plan, file);
        match format {
            Format::Csv => {
                writeln!(out, "entry,time,input,state,sequence,life,note")?;
                write_rows(out, entries)?;
            }
            Format::Rows => write_rows(out, entries)?,
            Format::Jsonl => write_jsonl(out, &recorder, entries)?,
        }
        bytes += path.metadata()?.len();
        paths.push(path);
    }
    Ok(Written { paths, bytes, _folder: folder })
}

fn write_rows(mut out: impl Write, entries: impl Iterator<Item = EntryRecord>) -> io::Result<()> {
    for EntryRecord { number, entry, sequence, life, .. } in entries {
        for input in entry.changed.numbers() {
            let state = u8::from(entry.state.contains(input));
            let sequence = sequence.unwrap_or_default();
            writeln!(out, "{number},{},{input},{state},{sequence},{life},", entry.time)?;
        }
    }
    out.flush()
}

fn write_jsonl(
    out: impl Write,
    recorder: &str,
    mut entries: impl Iterator<Item = EntryRecord>,
) -> io::Result<()> {
    let mut lines = Writer::new(out);
    lines.file("ser-cli")?;
    entries.try_for_each(|entry| lines.record(recorder, &Record::Entry(entry)))?;
    lines.flush()
}

/// The entries of one recorder: incidents with quiet time between them, over some weeks.
fn entries(plan: Plan, file: u64) -> impl Iterator<Item = EntryRecord> {
    let mut chance = Rand64::new(u128::from(plan.seed) << 64 | u128::from(file));
    let count = plan.entries / plan.files;
    let quiet_ms = SPAN_MS * INCIDENT_ENTRIES / count;
    let (mut at_ms, mut left, mut state, mut life) = (0, 0, 0_u32, Life::UNKNOWN);
    (0..count).map(move |index| {
        if left == 0 {
            left = chance.rand_range(INCIDENT_ENTRIES / 2..INCIDENT_ENTRIES * 3 / 2);
            at_ms += 1 + chance.rand_range(0..2 * quiet_ms);
        }
        left -= 1;
        at_ms += chance.rand_range(1..200);
        if index % LIFE_ENTRIES == 0 {
            (life, state) = (Life::from_bits(chance.rand_u64() | 1), 0);
        }
        let changed = changed(&mut chance);
        state ^= changed;
        let place = index % LIFE_ENTRIES;
        let at = Moment::from_us(BEGIN_US).after(i64::try_from(at_ms * 1000).unwrap_or(i64::MAX));
        EntryRecord {
            life,
            sequence: Some(place + 1),
            number: u16::try_from(place % LOG_SIZE + 1).unwrap_or_default(),
            entry: Entry {
                changed: Inputs(changed),
                state: Inputs(state),
                time: stamp(at).expect("a time of this century"),
            },
            known: EntryRecord::ALL_KNOWN,
        }
    })
}

/// Mostly one input, sometimes a few.
fn changed(chance: &mut Rand64) -> u32 {
    let count = match chance.rand_range(0..100) {
        0 => 8,
        1..5 => 4,
        5..15 => 2,
        _ => 1,
    };
    (0..count).fold(0, |changed, _| changed | 1 << chance.rand_range(0..32))
}
