//! `genius broadcast`: one command to all recorders, and whether each has received it.

use std::io::{self, Write};

use ser_client::GeniHost;
use ser_proto::{Command, LastBroadcast, TimeStamp};

use super::recorder_inputs;
use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::{Failure, Result, inform};
use crate::time::{local_time_in, parse_time};

#[derive(Clone, Copy, Debug, clap::Subcommand)]
pub(super) enum What {
    /// Set all clocks, to the time at which the broadcast arrives.
    Clock {
        /// The time to set; the local time of this computer if not given.
        #[arg(long, value_name = "TIME", value_parser = parse_time)]
        at: Option<TimeStamp>,
    },
    /// Start recording everywhere.
    Start,
    /// Stop recording everywhere.
    Stop,
    /// Erase all events of all recorders. There is no way back.
    Erase {
        /// Do it; without it nothing is done.
        #[arg(long)]
        yes: bool,
    },
}

pub(super) fn run(connection: &ConnectionArgs, what: What) -> Result<()> {
    if let What::Erase { yes: false } = what {
        return Err(Failure::usage("this erases all events of all recorders on the bus for good")
            .hint("keep them first: ser-cli read --all --format csv > events.csv, for each of them")
            .hint("then add --yes"));
    }
    let host = connection::open_bus(connection)?;
    let recorders: Vec<u8> = host
        .devices()?
        .iter()
        .filter(|device| recorder_inputs(device).is_some())
        .map(|device| device.number)
        .collect();
    if recorders.is_empty() {
        return Err(Failure::new("no recorder is logged in")
            .hint("ser-cli genius devices lists what is; check numbers and bus rate"));
    }
    // The same broadcast may have come before: what tells the two apart is the time.
    let before: Vec<_> = recorders.iter().map(|&node| last_broadcast(&host, node, connection)).collect();
    let command = command(what, &host)?;
    host.broadcast(&command)?;
    if let Command::SetClock(time) = command {
        inform(format_args!("sent {time}"));
    }
    let mut out = io::stdout().lock();
    writeln!(out, "node  received  last broadcast")?;
    let mut missing = Vec::new();
    for (&node, before) in recorders.iter().zip(before) {
        let after = last_broadcast(&host, node, connection);
        let received = has_received(
            &command,
            before.as_ref().ok().copied().flatten(),
            after.as_ref().ok().copied().flatten(),
        );
        if !received {
            missing.push(node.to_string());
        }
        let text = match after {
            Ok(Some(last)) => last.to_string(),
            Ok(None) => "none since power-up".to_string(),
            Err(why) => why,
        };
        writeln!(out, "{node:>4}  {:<8}  {text}", if received { "yes" } else { "no" })?;
    }
    out.flush()?;
    if missing.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("not received, as far as is known, by {}", missing.join(", ")))
        .hint("send it again; if it persists, look for bus errors and at the devices"))
}

fn command(what: What, host: &GeniHost) -> Result<Command> {
    Ok(match what {
        What::Clock { at: Some(time) } => Command::SetClock(time),
        What::Clock { at: None } => Command::SetClock(local_time_in(host.delay()).map_err(|year| {
            Failure::new(format!("a unit's clock runs from 1970 to 2069; this computer's says {year}"))
                .hint("set this computer's clock, or give the time with --at")
        })?),
        What::Start => Command::SetMode { recording: true },
        What::Stop => Command::SetMode { recording: false },
        What::Erase { .. } => Command::Erase,
    })
}

/// What a recorder last received as a broadcast, or why that is not known.
fn last_broadcast(
    host: &GeniHost,
    node: u8,
    connection: &ConnectionArgs,
) -> std::result::Result<Option<LastBroadcast>, String> {
    host.unit(node, connection::options(connection)).last_broadcast().map_err(|error| error.to_string())
}

fn has_received(command: &Command, before: Option<LastBroadcast>, after: Option<LastBroadcast>) -> bool {
    after.is_some_and(|last| last.code == command.code().byte()) && after != before
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_new_broadcast_of_this_command_counts() {
        let last = |code, second| Some(LastBroadcast { code, hour: 10, minute: 0, second, millisecond: 0 });
        for (before, after, received) in [
            (None, last(0x45, 1), true),
            (last(0x45, 1), last(0x45, 2), true),
            (last(0x45, 1), last(0x45, 1), false),
            (None, last(0x53, 1), false),
            (last(0x45, 1), None, false),
        ] {
            assert_eq!(has_received(&Command::Erase, before, after), received, "{before:?} {after:?}");
        }
    }
}
