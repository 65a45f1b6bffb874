//! `ser-cli`, and the tools of every Unix.

use std::path::PathBuf;
use std::process::Command;

use crate::measure::Job;

fn ours(name: &'static str, verb: &[&str], paths: &[PathBuf]) -> Job {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ser-cli"));
    command.args(verb).arg("--input").args(paths);
    Job { name, command }
}

/// Everything in one list.
pub(crate) fn ours_merge(paths: &[PathBuf]) -> Job {
    ours("ser-cli merge --format csv", &["merge", "--format", "csv"], paths)
}

/// The report of the last incident.
pub(crate) fn ours_report(paths: &[PathBuf]) -> Job {
    ours("ser-cli report --last", &["report", "--last"], paths)
}

/// Merges rows of CSV by the text of their time, which takes every file to be in order. It is
/// allowed to have all files open at once.
pub(crate) fn sort(paths: &[PathBuf]) -> Job {
    let mut command = Command::new("sort");
    command.args(["-m", "-t,", "-k2,2", &format!("--batch-size={}", paths.len().max(2))]);
    command.args(paths);
    Job { name: "sort -m, rows by their time", command }
}
