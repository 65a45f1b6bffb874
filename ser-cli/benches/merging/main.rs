//! How long `merge` and `report --last` take over many files, beside what one would use instead.
//!
//! `cargo bench -p ser-cli --bench merging` writes files of thirty-two recorders with a seed, runs
//! `ser-cli` and its rivals over the same files, and prints what each took. Before that it compares
//! results at a smaller size: what is fast and wrong is worth nothing. Run as a test, it does only
//! that.

mod check;
mod duckdb;
mod files;
mod measure;
mod rivals;

use std::path::Path;

use clap::Parser;

use duckdb::DuckDb;
use files::{Format, Plan};
use measure::{Job, Result};

#[derive(Debug, Parser)]
struct Arguments {
    /// Entries of all files together.
    #[arg(long, default_value_t = 10_000_000)]
    entries: u64,

    /// Files, one recorder each.
    #[arg(long, default_value_t = 32)]
    files: u64,

    /// How often each is run.
    #[arg(long, default_value_t = 3)]
    repetitions: usize,

    /// Where chance begins.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Passed by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Files that are compared, row by row.
const SMALL: Plan = Plan { entries: 40_000, files: 8, seed: 7 };

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let duckdb = if arguments.bench { DuckDb::at(&place.join("duckdb")) } else { None };
    let folder = tempfile::Builder::new().prefix("merging-").tempdir_in(place)?;
    check::results(folder.path(), SMALL, duckdb.as_ref())?;
    if !arguments.bench {
        return Ok(());
    }
    let Arguments { entries, files, seed, .. } = arguments;
    let plan = Plan { entries, files, seed };
    println!("{entries} entries of {files} recorders, {} runs each", arguments.repetitions);
    for format in [Format::Csv, Format::Jsonl] {
        let written = files::write(folder.path(), plan, format)?;
        println!("\n{format}: {} MB", written.bytes / 1_000_000);
        let mut jobs = jobs(format, &written.paths, duckdb.as_ref());
        let rows = (format == Format::Csv)
            .then(|| files::write(folder.path(), plan, Format::Rows))
            .transpose()?;
        jobs.extend(rows.as_ref().map(|rows| rivals::sort(&rows.paths)));
        measure::table(&jobs, arguments.repetitions)?;
    }
    if duckdb.is_none() {
        println!("\nNOT COMPARED WITH DuckDB: it could not be set up; see above why.");
    }
    Ok(())
}

/// What is measured over the files of one format.
fn jobs(format: Format, paths: &[std::path::PathBuf], duckdb: Option<&DuckDb>) -> Vec<Job> {
    let mut jobs = vec![rivals::ours_merge(paths)];
    jobs.extend(duckdb.map(|duckdb| duckdb.merge(format, paths, Path::new("/dev/null"))));
    jobs.push(rivals::ours_report(paths));
    jobs.extend(duckdb.map(|duckdb| duckdb.last_incident(format, paths)));
    jobs
}
