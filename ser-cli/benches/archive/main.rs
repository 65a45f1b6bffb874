//! How long a report on one incident takes out of an archive of ten million entries.
//!
//! `cargo bench -p ser-cli --bench archive` fills an archive with some years of a plant, runs
//! `ser-cli report`, `events` and `incident list` over it, and what one would use instead: a report
//! from a file with a part of the same entries, and `sqlite3` with a question of its own to the
//! same archive, which knows nothing of clocks or losses. Before that it holds a report from a
//! small archive against one from the same records in a file. Run as a test, it does only that.

#[path = "../merging/measure.rs"]
mod measure;
mod plant;

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use clap::Parser;
use serde_json::Value;

use measure::{Job, Result};
use plant::{Plan, Written};

#[derive(Debug, Parser)]
struct Arguments {
    /// Entries of all recorders together.
    #[arg(long, default_value_t = 10_000_000)]
    entries: u64,

    /// Recorders.
    #[arg(long, default_value_t = 32)]
    recorders: u64,

    /// Days that the entries are of.
    #[arg(long, default_value_t = 1800)]
    days: u64,

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

/// Of which reports are compared.
const SMALL: Plan = Plan { entries: 20_000, recorders: 4, days: 100, seed: 7 };

/// How much smaller the file is from which a report is made as well.
const PART: u64 = 100;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let place = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let folder = tempfile::Builder::new().prefix("archive-").tempdir_in(place)?;
    compare(&plant::write(folder.path(), SMALL)?)?;
    if !arguments.bench {
        return Ok(());
    }
    let Arguments { entries, recorders, days, seed, repetitions, .. } = arguments;
    let plan = Plan { entries, recorders, days, seed };
    let began = Instant::now();
    let all = plant::write(folder.path(), plan)?;
    println!(
        "{entries} entries of {recorders} recorders in {days} days: {} MB, written in {:.0} s, with \
         the same as JSON lines",
        all.bytes / 1_000_000,
        began.elapsed().as_secs_f64()
    );
    let part = Plan { entries: entries / PART, days: (days / PART).max(1), ..plan };
    let part = plant::write(folder.path(), part)?;
    measure::table(&jobs(&all, &part, days)?, repetitions)
}

fn jobs(all: &Written, part: &Written, days: u64) -> Result<Vec<Job>> {
    let middle = plant::time_on(days / 2)?;
    let ours = |name, words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ser-cli"));
        command.args(words).arg("--archive").arg(&all.archive);
        Job { name, command }
    };
    let mut from_part = Command::new(env!("CARGO_BIN_EXE_ser-cli"));
    from_part.args(["report", "--last", "--input"]).arg(&part.lines);
    let mut sqlite = Command::new("sqlite3");
    sqlite.arg(&all.archive).arg(
        "SELECT recorder.name, sequence, shown_us, changed, state FROM entry \
         JOIN recorder ON recorder.id = entry.recorder \
         ORDER BY shown_us DESC LIMIT 100",
    );
    Ok(vec![
        ours("report --around, in the middle", &["report", "--around", &middle]),
        ours("report --last", &["report", "--last"]),
        ours("report (the last trip)", &["report"]),
        ours("events, the newest 100", &["events"]),
        ours("incident list, 30 days", &["incident", "list"]),
        ours("archive check", &["archive", "check"]),
        ours("archive verify", &["archive", "verify"]),
        Job { name: "report --last from 1 % as a file", command: from_part },
        Job { name: "sqlite3, the newest 100 by their stamps", command: sqlite },
    ])
}

/// A report from the archive says what one from all records says.
fn compare(small: &Written) -> Result<()> {
    let report = |source: &str, path: &Path, choice: &[&str]| -> Result<Value> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ser-cli"));
        command.args(["report", "--format", "json", source]).arg(path).args(choice);
        Ok(serde_json::from_str(&measure::output(&Job { name: "report", command })?)?)
    };
    for day in [0, 50, 99] {
        let time = plant::time_on(day)?;
        for choice in [&["--around", &*time][..], &["--last"]] {
            let part = report("--archive", &small.archive, choice)?;
            let whole = report("--input", &small.lines, choice)?;
            for key in ["entries_sha256", "sequence", "first_out"] {
                if part.get(key) != whole.get(key) {
                    return Err(format!("{choice:?}: {key} differs").into());
                }
            }
        }
    }
    Ok(())
}
