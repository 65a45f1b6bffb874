//! `ports`: the serial ports of this computer.

use std::io::{self, Write};

use ser_client::PortInfo;
use ser_console::Harmless;

use crate::error::{Result, advise, inform};

const EXAMPLES: &str = "\
Examples:
  ser-cli ports
  ser-cli status -p /dev/ttyUSB0  ask the recorder on one of them";

/// List the serial ports of this computer.
///
/// Pseudo-terminals (`ser-cli sim --pty`) and links (/dev/serial/by-id/…) are not listed, but can
/// be used as well.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {}

pub(crate) fn run(_args: &Args) -> Result<()> {
    let ports = ser_client::ports();
    table(&mut io::stdout().lock(), &ports)?;
    if ports.is_empty() {
        inform("this computer has no serial ports");
        advise("plug in a USB adapter, or use a terminal server with --port tcp://HOST:PORT");
        advise("ser-cli sim --pty /tmp/ser simulates a recorder");
    }
    Ok(())
}

/// One port per line, whatever the ports are called.
fn table(out: &mut dyn Write, ports: &[PortInfo]) -> io::Result<()> {
    let paths: Vec<String> = ports.iter().map(|port| Harmless(&port.path).line()).collect();
    let width = paths.iter().map(String::len).max().unwrap_or(0);
    for (path, PortInfo { description, .. }) in paths.iter().zip(ports) {
        match Harmless(description).line().as_str() {
            "" => writeln!(out, "{path}")?,
            description => writeln!(out, "{path:width$}  {description}")?,
        }
    }
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_for_each_port_and_nothing_that_a_terminal_obeys() {
        let port = |path: &str, description: &str| PortInfo {
            path: path.to_owned(),
            description: description.to_owned(),
        };
        let mut out = Vec::new();
        let ports = [
            port("/dev/ttyS0", ""),
            port("/dev/tty\u{1B}c", "FTDI\n\u{202E}"),
            port("COM3", "PCI"),
        ];
        table(&mut out, &ports).unwrap();
        let expected = "/dev/ttyS0\n/dev/tty\\u{1b}c  FTDI\\n\\u{202e}\nCOM3             PCI\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }
}
