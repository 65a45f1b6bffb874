//! `ports`: the serial ports of this computer.

use std::io::{self, Write};

use crate::error::{Result, advise, inform};

const EXAMPLES: &str = "\
Examples:
  ser-cli ports
  ser-cli status -p /dev/ttyUSB0  ask the unit on one of them how it is";

/// List the serial ports of this computer.
///
/// Pseudo-terminals (`ser-cli sim --pty`) and links (/dev/serial/by-id/…) are not listed, but can be used as well.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {}

pub(crate) fn run(_args: &Args) -> Result<()> {
    let ports = ser_client::ports();
    let width = ports.iter().map(|port| port.path.len()).max().unwrap_or(0);
    let mut out = io::stdout().lock();
    for port in &ports {
        match port.description.as_str() {
            "" => writeln!(out, "{}", port.path)?,
            description => writeln!(out, "{:width$}  {description}", port.path)?,
        }
    }
    out.flush()?;
    if ports.is_empty() {
        inform("this computer has no serial ports");
        advise("plug in a USB adapter, or use a terminal server with --port tcp://HOST:PORT");
        advise("ser-cli sim --pty /tmp/ser simulates a unit");
    }
    Ok(())
}
