//! `last-broadcast`: the last command that arrived over the Genius bus as a broadcast.

use std::io::{self, Write};

use crate::connection::{self, ConnectionArgs};
use crate::error::Result;

const EXAMPLES: &str = "\
Examples:
  ser-cli last-broadcast --port /dev/ttyUSB0";

/// Show which command the recorder last received as a Genius broadcast, and when.
///
/// Broadcasts get no reply on the bus; use this to check that one was received.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {}

pub(crate) fn run(_args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let last = connection::open(connection)?.last_broadcast()?;
    let mut out = io::stdout().lock();
    match last {
        Some(last) => writeln!(out, "{last}")?,
        None => writeln!(out, "none since power-up")?,
    }
    out.flush()?;
    Ok(())
}
