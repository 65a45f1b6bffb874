//! `start` and `stop`: switch recording on and off.

use crate::audit::AuditArgs;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, inform};

const START_EXAMPLES: &str = "\
Examples:
  ser-cli start --port /dev/ttyUSB0";

const STOP_EXAMPLES: &str = "\
Examples:
  ser-cli stop --port /dev/ttyUSB0";

/// Start recording. Changes while the recorder was stopped do not become events.
#[derive(Debug, clap::Args)]
#[command(after_help = START_EXAMPLES)]
pub(crate) struct StartArgs {
    #[command(flatten)]
    _audit: AuditArgs,
}

/// Stop recording until `start` or the next power-up. Events recorded so far stay.
#[derive(Debug, clap::Args)]
#[command(after_help = STOP_EXAMPLES)]
pub(crate) struct StopArgs {
    #[command(flatten)]
    _audit: AuditArgs,
}

pub(crate) fn start(_args: &StartArgs, connection: &ConnectionArgs) -> Result<()> {
    set_recording(connection, true)
}

pub(crate) fn stop(_args: &StopArgs, connection: &ConnectionArgs) -> Result<()> {
    set_recording(connection, false)
}

fn set_recording(connection: &ConnectionArgs, recording: bool) -> Result<()> {
    let mode = connection::open(connection)?.set_recording(recording)?;
    inform(mode);
    Ok(())
}
