//! What was done to recorders, written down as it is done.
//!
//! Every connection that this program opens gets a hook here. It adds a record to `audit.jsonl` in
//! the state directory for each command that changes a recorder, once what came of it is known and
//! before the command itself learns of it. An interrupt that ends the program meanwhile writes down
//! that no answer came. What a user wanted done is worth more than the record: if that cannot be
//! written, it is told, and the command goes on. Where `SER_ARCHIVE` names an archive, the record
//! goes there instead.

#[cfg(feature = "archive")]
mod archived;
mod file;
mod under_way;

use std::io;
use std::path::{Path, PathBuf};

#[cfg(unix)]
use ser_client::GeniHost;
use ser_client::{Outcome, Stage, Unit};
use ser_evidence::record::{Record, Told};
use ser_observer::Author;

use crate::error::{Result, advise, warn};
use crate::output::PROGRAM;
use crate::state;
#[cfg(feature = "archive")]
pub(crate) use archived::{collector, named};
use file::AuditFile;
pub(crate) use file::{Position, Since};
use under_way::UnderWay;

/// Where commands are written down, for subcommands that keep nothing else. The command line finds
/// it by its name in every subcommand, so nobody passes it on.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct AuditArgs {
    /// Where to write down what is done to recorders (audit.jsonl); without it, the user's state
    /// directory (~/.local/state/ser-cli).
    #[arg(long, env = "SER_STATE_DIR", hide_env_values = true, value_name = "DIR")]
    state_dir: Option<PathBuf>,
}

impl AuditArgs {
    /// The directory, if the user wants another than the system's place for state.
    #[cfg(feature = "archive")]
    pub(crate) fn directory(&self) -> Option<&Path> {
        self.state_dir.as_deref()
    }
}

/// Where commands go, and where they are written down.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// The state directory, if it is not the system's.
    pub(crate) directory: Option<PathBuf>,
    /// The recorder's name, or that of the bus.
    pub(crate) recorder: String,
    /// The port, or the bus.
    pub(crate) peer: String,
}

/// Writes down what this connection changes in its recorder.
pub(crate) fn of_recorder(unit: &mut Unit, place: Place) {
    let mut under_way = None;
    unit.on_change(Box::new(move |change, stage| {
        follow(&place, &mut under_way, change.to_string(), stage);
    }));
}

/// Writes down what this host changes in all recorders on its bus.
#[cfg(unix)]
pub(crate) fn of_bus(host: &GeniHost, place: Place) {
    let mut under_way = None;
    host.on_change(Box::new(move |change, stage| {
        follow(&place, &mut under_way, format!("broadcast: {change}"), stage);
    }));
}

fn follow(place: &Place, under_way: &mut Option<UnderWay>, command: String, stage: Stage<'_>) {
    match stage {
        Stage::Begins => *under_way = Some(UnderWay::begin(place.clone(), command, write)),
        Stage::Ended(outcome) => {
            if let Some(begun) = under_way.take() {
                begun.end(command, outcome);
            }
        }
    }
}

fn write(place: &Place, command: String, outcome: &Outcome) {
    let record = Author::of_this_program(PROGRAM).record(&place.peer, command, outcome);
    let told = Told { recorder: place.recorder.clone(), record: Record::Command(record) };
    #[cfg(feature = "archive")]
    if archived::add(&told) {
        return;
    }
    keep(&told, place.directory.as_deref());
}

/// Adds a record to the state directory. A failure is told.
pub(crate) fn keep(told: &Told, directory: Option<&Path>) {
    let file = match file(directory) {
        Ok(file) => file,
        Err(failure) => {
            failure.warn();
            return tell_unwritten();
        }
    };
    if let Err(error) = file.append(told) {
        warn(format_args!("cannot write {}: {error}", file.path().display()));
        tell_unwritten();
    }
}

fn tell_unwritten() {
    advise(
        "what was done to the recorder is not written down; --state-dir DIR names another folder",
    );
}

fn file(directory: Option<&Path>) -> Result<AuditFile> {
    Ok(AuditFile::new(state::directory(directory)?))
}

/// Where the records are written.
pub(crate) fn path(directory: Option<&Path>) -> Result<PathBuf> {
    Ok(file(directory)?.path())
}

/// The records behind a position, from all files, oldest first; from the beginning without one. A
/// position holds across runs, and when the file was put aside because it had grown long. If the
/// file that it is in is gone, everything that is left comes, so nothing is missed and some may
/// come again.
///
/// # Errors
/// If a file cannot be read. Damaged lines are passed over and told in [`Since::damaged`].
pub(crate) fn since(directory: Option<&Path>, position: Option<Position>) -> Result<Since> {
    let file = file(directory)?;
    file.since(position)
        .map_err(|error: io::Error| crate::error::Failure::reading(file.path().display(), &error))
}
