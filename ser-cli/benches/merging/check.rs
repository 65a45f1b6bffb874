//! Whether results are right, at a size that can be compared row by row.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::duckdb::DuckDb;
use crate::files::{self, Format, Plan};
use crate::measure::{self, Result};
use crate::rivals;

/// Columns of a file: entry, time, input, state, sequence, life, and a note.
const COLUMNS: usize = 7;

/// Compares `ser-cli merge` with the files themselves, CSV with JSON lines, and with the rivals.
pub(crate) fn results(folder: &Path, plan: Plan, duckdb: Option<&DuckDb>) -> Result<()> {
    let csv = files::write(folder, plan, Format::Csv)?;
    let jsonl = files::write(folder, plan, Format::Jsonl)?;
    let merged = measure::output(&rivals::ours_merge(&csv.paths))?;
    each_once_and_in_order(&merged, &csv.paths)?;
    let from_jsonl = measure::output(&rivals::ours_merge(&jsonl.paths))?;
    same(&merged, &from_jsonl, "CSV and JSON lines give different lists")?;
    let rows = files::write(folder, plan, Format::Rows)?;
    let sorted = measure::output(&rivals::sort(&rows.paths))?;
    same(&times(&merged), &times(&sorted), "sort -m has other times")?;
    if let Some(duckdb) = duckdb {
        for (format, paths) in [(Format::Csv, &csv.paths), (Format::Jsonl, &jsonl.paths)] {
            let to = folder.join(format!("{format} by DuckDB.csv"));
            measure::output(&duckdb.merge(format, paths, &to))?;
            let theirs = times(&fs::read_to_string(&to)?.replace(' ', "T"));
            let theirs: Vec<String> = theirs.iter().map(|time| in_ms(time)).collect();
            same(&times(&merged), &theirs, "DuckDB has other times")?;
        }
    }
    let all: Vec<PathBuf> = csv.paths.iter().chain(&jsonl.paths).cloned().collect();
    let twice = measure::output(&rivals::ours_merge(&all))?;
    same(&merged, &twice, "what is read twice is not there once")?;
    println!("results agree over {} entries of {} recorders", plan.entries, plan.files);
    Ok(())
}

/// The rows of each recorder are those of its file, and the list never goes back.
fn each_once_and_in_order(merged: &str, paths: &[PathBuf]) -> Result<()> {
    let mut of_recorders: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut utc_before = "";
    for row in merged.lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let (own, [recorder, utc, ..]) = fields.split_at(COLUMNS) else {
            return Err(format!("this row has too few columns: {row}").into());
        };
        if *utc < utc_before {
            return Err(format!("this row is earlier than the one before: {row}").into());
        }
        utc_before = utc;
        of_recorders.entry(recorder).or_default().push(own.join(","));
    }
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let rows: Vec<String> =
            fs::read_to_string(path)?.lines().skip(1).map(ToOwned::to_owned).collect();
        let merged = of_recorders.remove(&*name).unwrap_or_default();
        same(&rows, &merged, &format!("the rows of {name} are not those of its file"))?;
    }
    same(&of_recorders.len(), &0, "there are more recorders than files")
}

/// The second column of all rows but headers.
fn times(rows: &str) -> Vec<String> {
    let second = rows.lines().filter_map(|row| row.split(',').nth(1));
    second.filter(|time| *time != "time").map(ToOwned::to_owned).collect()
}

/// With three digits of a second, as recorders have them.
fn in_ms(time: &str) -> String {
    let (seconds, fraction) = time.split_once('.').unwrap_or((time, ""));
    format!("{seconds}.{fraction:0<3}")
}

fn same<T: PartialEq>(one: &T, other: &T, or: &str) -> Result<()> {
    (one == other).then_some(()).ok_or_else(|| or.into())
}
