//! `print`: the unit prints entries on its RS-232 port, which is the line we are on.

use std::io::{self, Write};
use std::time::Duration;

use ser_client::{LineRate, Unsolicited};

use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::{Result, inform, warn};
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli print --from 1 --count 20";

/// A line with 32 changes and a good deal more.
const LONGEST_LINE: usize = 300;

/// Let the unit print entries as lines of text, and show them.
///
/// The unit prints on its RS-232 port whatever the command came by. Through a terminal server or a printer sharer the
/// lines arrive here only if they are passed on. Waiting ends when all lines are there, or none comes any more.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Number of the first entry.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    from: u16,

    /// How many.
    #[arg(long, value_name = "N", value_parser = values::entries())]
    count: u16,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    unit.print(args.from, args.count)?;
    let patience = connection.timeout.unwrap_or(Duration::from_secs(1))
        + LineRate::from(unit.bits_per_second()).time_for(LONGEST_LINE);
    let mut out = io::stdout().lock();
    let mut printed = 0;
    while printed < args.count {
        match unit.wait_event(patience)? {
            None => break,
            Some(Unsolicited::Report(_)) => {}
            Some(Unsolicited::Line(line)) => {
                writeln!(out, "{}", line.text)?;
                out.flush()?;
                if line.noise > 0 || line.cut {
                    warn("the line above arrived damaged");
                }
                printed += 1;
            }
        }
    }
    if printed < args.count {
        inform(format_args!("{printed} of {} lines came; only entries that exist are printed", args.count));
    }
    Ok(())
}
