//! `erase`: erases all events.

use ser_evidence::record::{LifeRecord, Record};

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::keeper::{Keeper, StateArgs};
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;

const EXAMPLES: &str = "\
Examples:
  ser-cli read --new --fail-on-loss >> log && ser-cli erase --yes

The erase is remembered, together with what read --new and watch have delivered. If everything \
had been delivered, the next read --new continues with the new log and reports no loss. Events \
recorded between a read and the erase are erased, too, and then reported as a loss. A change at \
the very moment of the erase leaves no trace if it is undone before the next event.";

/// Erase all events in the recorder. This cannot be undone.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Confirm the erase; without it nothing is done.
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
    // If the state file cannot be read, or another run is using it, the command must stop before
    // anything is erased.
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
    let can_tell = Originals::of(&args.state, connection)?.identity(&mut unit)?.is_some();
    unit.erase()?;
    inform(erased(total));
    // Whatever comes of this, the log is erased.
    let (log, name) = match can_tell {
        true => log_identity::begun_anew(&mut unit).unwrap_or_default(),
        false => (None, None),
    };
    keeper.propose(name);
    let before = keeper.place();
    if keeper.erased(total)?
        && let Some(log) = log
    {
        keeper.read_from(log)?;
    }
    if let (Some((before, _)), Some((life, _))) = (before, keeper.place())
        && before != life
    {
        let erased = Some(before);
        let record = LifeRecord { life, is_exact: true, model: None, size: keeper.size(), erased };
        KeptRecords::of(&args.state, connection)?.add(&[Record::Life(record)]);
    }
    Ok(())
}

fn erased(total: u16) -> String {
    let events = if total == 1 { "1 event".to_owned() } else { format!("{total} events") };
    format!(
        "event buffer erased; {events} had been recorded since the previous erase (the recorder \
         counts modulo 65536)"
    )
}
