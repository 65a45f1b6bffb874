//! What was done to recorders, written down as it is done.
//!
//! Every connection that this program opens gets a hook here. It adds a record to `audit.jsonl` in
//! the state directory for each command that changes a recorder, once what came of it is known and
//! before the command itself learns of it. What a user wanted done is worth more than the record: if
//! that cannot be written, it is told, and the command goes on.

mod file;

use std::io;
use std::path::{Path, PathBuf};

#[cfg(unix)]
use ser_client::GeniHost;
use ser_client::{Change, Outcome, Unit};
use ser_evidence::record::{Record, Told};
use ser_observer::Author;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, advise, warn};
use crate::output::PROGRAM;
use crate::state;
use file::AuditFile;
pub(crate) use file::{Position, Since};

/// Where commands are written down, for subcommands that keep nothing else. The command line finds it
/// by its name in every subcommand, so nobody passes it on.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct AuditArgs {
    /// Where to write down what is done to recorders (audit.jsonl); without it, the user's state
    /// directory (~/.local/state/ser-cli).
    #[arg(long, env = "SER_STATE_DIR", hide_env_values = true, value_name = "DIR")]
    state_dir: Option<PathBuf>,
}

/// Writes down what this connection changes in its recorder.
pub(crate) fn of_recorder(unit: &mut Unit, connection: &ConnectionArgs) {
    let peer = connection::port_text(connection).unwrap_or_default().to_owned();
    let recorder = connection::recorder_name(connection).unwrap_or_else(|_| peer.clone());
    let directory = connection.state_dir.clone();
    unit.on_change(Box::new(move |change, outcome| {
        write(directory.as_deref(), (&recorder, &peer), change.to_string(), outcome);
    }));
}

/// Writes down what this host changes in all recorders on its bus.
#[cfg(unix)]
pub(crate) fn of_bus(host: &GeniHost, bus: &str, connection: &ConnectionArgs) {
    let (bus, directory) = (bus.to_owned(), connection.state_dir.clone());
    host.on_change(Box::new(move |change: &Change, outcome: &Outcome| {
        write(directory.as_deref(), (&bus, &bus), format!("broadcast: {change}"), outcome);
    }));
}

fn write(
    directory: Option<&Path>,
    (recorder, peer): (&str, &str),
    command: String,
    outcome: &Outcome,
) {
    let record = Author::of_this_program(PROGRAM).record(peer, command, outcome);
    let file = match file(directory) {
        Ok(file) => file,
        Err(failure) => {
            failure.warn();
            return tell_unwritten();
        }
    };
    let told = Told { recorder: recorder.to_owned(), record: Record::Command(record) };
    if let Err(error) = file.append(&told) {
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
/// file that it is in is gone, everything that is left comes, so nothing is missed and some may come
/// again.
///
/// # Errors
/// If a file cannot be read. Damaged lines are passed over and told in [`Since::damaged`].
pub(crate) fn since(directory: Option<&Path>, position: Option<Position>) -> Result<Since> {
    let file = file(directory)?;
    file.since(position)
        .map_err(|error: io::Error| crate::error::Failure::reading(file.path().display(), &error))
}
