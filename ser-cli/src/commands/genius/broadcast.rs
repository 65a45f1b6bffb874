//! `genius broadcast`: one command to all recorders, and a check that each has received it.

use std::io::{self, Write};

use ser_client::{GeniHost, Recognition};
use ser_evidence::record::{How, Record};
use ser_evidence::time::shown;
use ser_observer::{ClockSetting, setting};
use ser_proto::{Command, TimeStamp};

use super::super::clock::Format;
use super::check::{Asked, Check, Heard};
use super::{mark, no_recorder, silent_candidates};
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::keeper::StateArgs;
use crate::output;
use crate::time::{local_time_in, parse_time};

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Subcommand)]
pub(super) enum What {
    /// Set all clocks, to the time at which the broadcast arrives.
    Clock {
        /// The time to set; if not given, what the site file says, or this computer's local time.
        #[arg(long, value_name = "TIME", value_parser = parse_time)]
        at: Option<TimeStamp>,

        /// What is written to standard output.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Compare all clocks without setting any: what does each show at one moment?
    ///
    /// A command that does nothing is broadcast. Each recorder notes when it came, by its own
    /// clock, and is asked for that. The times are exact to a millisecond. If all recorders can be
    /// asked for their clocks, the command is a mark that is known from all others, and told with
    /// its day.
    Mark {
        /// What is written to standard output.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Start recording everywhere.
    Start,
    /// Stop recording everywhere.
    Stop,
    /// Erase all events of all recorders. This cannot be undone.
    Erase {
        /// Confirm the erase; without it nothing is done.
        #[arg(long)]
        yes: bool,
    },
}

impl What {
    /// Whether it tells what the clocks show.
    const fn tells_time(self) -> bool {
        matches!(self, What::Clock { .. } | What::Mark { .. })
    }
}

pub(super) fn run(
    connection: &ConnectionArgs,
    what: What,
    how: Recognition,
    state: &StateArgs,
) -> Result<()> {
    if let What::Erase { yes: false } = what {
        return Err(Failure::usage("this erases all events of all recorders on the bus for good")
            .hint("keep them first: ser-cli read --all --format csv > events.csv, for each of them")
            .hint("then add --yes"));
    }
    let setting = connection.clock_setting_of_bus()?;
    let host = connection::open_bus(connection)?;
    let found = host.recorders(how)?;
    // Such a device is not asked whether it has received the broadcast.
    if let Some(silent) = silent_candidates(&found.silent) {
        warn(&silent);
    }
    let looks = what.tells_time().then_some(state);
    let ask = |(node, _)| Asked::before(&host, node, connection, looks);
    let mut asked: Vec<Asked> = found.recorders.into_iter().map(ask).collect();
    if asked.is_empty() {
        return Err(no_recorder());
    }
    let began = host.now();
    // A mark with a token reaches all of them, and an original one must never get it.
    let all_tell = found.silent.is_empty() && asked.iter().all(Asked::tells_clock);
    let command = send((what, all_tell), &host, setting.as_ref())?;
    let checks: Vec<Check> = asked.iter_mut().map(|asked| asked.check(&command, began)).collect();
    let records = match command {
        Command::SetClock(time) => remember_set(connection, state, &checks, time)?,
        _ => Vec::new(),
    };
    match what {
        What::Mark { format } => mark::run(connection, state, &checks, format)?,
        What::Clock { format: Format::Jsonl, .. } => {
            output::write_records(records.iter().map(|(name, record)| (name.as_str(), record)))?;
        }
        _ => {
            let mut out = io::stdout().lock();
            writeln!(out, "node  received   last broadcast")?;
            checks.iter().try_for_each(|check| writeln!(out, "{check}"))?;
            out.flush()?;
        }
    }
    conclude(&checks)
}

/// Sends the command, and tells the user the time in it, if any.
fn send(
    (what, all_tell): (What, bool),
    host: &GeniHost,
    setting: Option<&ClockSetting>,
) -> Result<Command> {
    let time_in = |ahead| match setting {
        Some(setting) => setting.time_in(ahead),
        None => local_time_in(ahead),
    };
    let command = match what {
        What::Clock { at: Some(time), .. } => Command::SetClock(time),
        What::Clock { at: None, .. } => {
            Command::SetClock(time_in(host.delay()).map_err(|year| {
                Failure::new(format!(
                    "a recorder's clock runs from 1970 to 2069; this computer's says {year}"
                ))
                .hint("set this computer's clock, or give the time with --at")
            })?)
        }
        What::Mark { .. } if all_tell => Command::Time { token: token()? },
        // Nobody answers a broadcast, so a read does nothing but being noted.
        What::Mark { .. } => Command::Read { start: 1, count: 1 },
        What::Start => Command::SetMode { recording: true },
        What::Stop => Command::SetMode { recording: false },
        What::Erase { .. } => Command::Erase,
    };
    host.broadcast(&command)?;
    if let Command::SetClock(time) = command {
        inform(format_args!("sent {time}"));
    }
    Ok(command)
}

/// A token that hardly any earlier mark has. Token 0 is that of no mark.
fn token() -> Result<u16> {
    let [low, high, ..] = getrandom::u64().map_err(io::Error::from)?.to_le_bytes();
    Ok(u16::from_le_bytes([low, high]).max(1))
}

/// Keeps that the clocks of these recorders were set, or may have been. Returns what it keeps.
fn remember_set(
    connection: &ConnectionArgs,
    state: &StateArgs,
    checks: &[Check],
    time: TimeStamp,
) -> Result<Vec<(String, Record)>> {
    let mut told = Vec::new();
    let how = How::Set { broadcast: Some(getrandom::u64().map_err(io::Error::from)?) };
    for check in checks {
        let record = match (check.heard, shown(&time)) {
            (Heard::Yes, Some(shown)) => check.observation(how, shown),
            (Heard::No, _) => continue,
            _ => setting::step(check.place()),
        };
        check.kept(connection, state)?.add(std::slice::from_ref(&record));
        told.push((check.name(connection)?, record));
    }
    Ok(told)
}

/// Fails unless every recorder is known to have received it.
fn conclude(checks: &[Check]) -> Result<()> {
    let those = |heard: Heard| {
        let nodes = checks.iter().filter(move |check| check.heard == heard);
        nodes.map(|check| check.node.to_string()).collect::<Vec<_>>()
    };
    inform(format_args!("{} of {} recorders received it", those(Heard::Yes).len(), checks.len()));
    let (deaf, unknown) = (those(Heard::No).join(", "), those(Heard::NotKnown).join(", "));
    let message = match (deaf.is_empty(), unknown.is_empty()) {
        (true, true) => return Ok(()),
        (false, true) => format!("not received by {deaf}"),
        (true, false) => format!("not known whether it was received by {unknown}"),
        (false, false) => {
            format!("not received by {deaf}, and not known whether it was received by {unknown}")
        }
    };
    Err(Failure::new(message).hint(
        "send it again (a clock with another time); if it persists, look for bus errors and at \
         the devices",
    ))
}

#[cfg(test)]
mod tests {
    use ser_proto::LastBroadcast;

    use super::super::check::Answer;
    use super::*;

    fn last(code: u8, second: u8) -> Answer {
        Ok(Some(LastBroadcast { code, hour: 12, minute: 0, second, millisecond: 0 }))
    }

    #[test]
    fn who_is_not_known_to_have_heard_is_named() {
        let check = |node, heard| Check {
            node,
            heard,
            after: last(0x45, 1),
            look: None,
            total_after: None,
            came: Default::default(),
            mark: None,
            clock: None,
        };
        assert!(conclude(&[check(5, Heard::Yes), check(9, Heard::Yes)]).is_ok());
        let failure =
            conclude(&[check(5, Heard::No), check(7, Heard::Yes), check(9, Heard::NotKnown)]);
        let text = failure.expect_err("two are missing").text();
        assert!(
            text.starts_with("not received by 5, and not known whether it was received by 9\n"),
            "{text}"
        );
        assert!(check(9, Heard::NotKnown).to_string().starts_with("   9  not known  "));
    }
}
