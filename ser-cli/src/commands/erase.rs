//! `erase`: away with the events.

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::keeper::{Keeper, StateArgs};

const EXAMPLES: &str = "\
Examples:
  ser-cli read --new --fail-on-loss >> log && ser-cli erase --yes

What read --new and watch have delivered is remembered, and so is this erase: if everything had \
been delivered, the \
next read --new goes on with the new log and tells of no loss. What is recorded between a read \
and the erase is erased, \
too, and then told as a loss. In the moment of the erase itself, a change that is undone before \
the next event leaves \
no trace.";

/// Erase all events in the recorder. There is no way back.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Do it; without it nothing is done.
    #[arg(long)]
    yes: bool,

    #[command(flatten)]
    state: StateArgs,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let port = connection::port_text(connection)?;
    if !args.yes {
        return Err(Failure::usage(format!(
            "this erases all events in the recorder at {port} for good"
        ))
        .hint("keep them first: ser-cli read --all --format csv > events.csv")
        .hint("then add --yes"));
    }
    // A memory that cannot be read, or that another run is using, is a reason to stop before
    // anything is gone.
    let mut keeper = Keeper::load(&args.state, connection)?;
    let mut unit = connection::open(connection)?;
    let total = unit.log_position()?.total;
    match keeper.unread(total) {
        0 => {}
        1 => warn("1 event has not been delivered by read --new or watch"),
        unread => {
            warn(format_args!("{unread} events have not been delivered by read --new or watch"));
        }
    }
    unit.erase()?;
    inform(erased(total));
    keeper.erased(total)
}

fn erased(total: u16) -> String {
    let events = if total == 1 { "1 event".to_owned() } else { format!("{total} events") };
    format!(
        "event buffer erased; {events} had been recorded since the erase before (the recorder \
         counts modulo 65536)"
    )
}
