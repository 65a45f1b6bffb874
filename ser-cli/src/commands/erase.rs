//! `erase`: away with the events.

use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::{Failure, Result, inform};

const EXAMPLES: &str = "\
Examples:
  ser-cli read --all --format csv > events.csv && ser-cli erase --yes

What is recorded between a read and the erase is erased, too. If that matters, stop first (ser-cli stop).";

/// Erase all events in the unit. There is no way back.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Do it; without it nothing is done.
    #[arg(long)]
    yes: bool,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let port = connection::port_text(connection)?;
    if !args.yes {
        return Err(Failure::usage(format!("this erases all events in the unit at {port} for good"))
            .hint("keep them first: ser-cli read --all --format csv > events.csv")
            .hint("then add --yes"));
    }
    let mut unit = connection::open(connection)?;
    let total = unit.log_position()?.total;
    unit.erase()?;
    inform(format_args!("event buffer erased: {total} events since the last erase (modulo 65536)"));
    Ok(())
}
