//! `genius broadcast`: one command to all recorders, and a check that each has received it.

use std::fmt;
use std::io::{self, Write};
use std::time::Duration;

use ser_client::{GeniHost, Recognition, Unit};
use ser_evidence::record::{How, Place, Record};
use ser_evidence::time::{Moment, Shown, shown};
use ser_proto::{Command, LastBroadcast, TimeStamp};

use super::{mark, no_recorder, silent_candidates};
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform, warn};
use crate::keeper::{self, StateArgs};
use crate::kept::KeptRecords;
use crate::log_look::LogLook;
use crate::setting;
use crate::site_file::ClockSetting;
use crate::time::{local_time_in, parse_time};

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Subcommand)]
pub(super) enum What {
    /// Set all clocks, to the time at which the broadcast arrives.
    Clock {
        /// The time to set; if not given, what the site file says, or this computer's local time.
        #[arg(long, value_name = "TIME", value_parser = parse_time)]
        at: Option<TimeStamp>,
    },
    /// Compare all clocks without setting any: what does each show at one moment?
    ///
    /// A command that does nothing is broadcast. Each recorder notes when it came, by its own
    /// clock, and is asked for that. The times are exact to a millisecond.
    Mark,
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
        matches!(self, What::Clock { .. } | What::Mark)
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
    let command = send(what, &host, setting.as_ref())?;
    let checks: Vec<Check> = asked.iter_mut().map(|asked| asked.check(&command, began)).collect();
    if let What::Mark = what {
        mark::run(connection, state, &checks)?;
    } else {
        let mut out = io::stdout().lock();
        writeln!(out, "node  received   last broadcast")?;
        checks.iter().try_for_each(|check| writeln!(out, "{check}"))?;
        out.flush()?;
    }
    if let Command::SetClock(time) = command {
        remember_set(connection, state, &checks, time)?;
    }
    conclude(&checks)
}

/// Sends the command, and tells the user the time in it, if any.
fn send(what: What, host: &GeniHost, setting: Option<&ClockSetting>) -> Result<Command> {
    let time_in = |ahead| match setting {
        Some(setting) => setting.time_in(ahead),
        None => local_time_in(ahead),
    };
    let command = match what {
        What::Clock { at: Some(time) } => Command::SetClock(time),
        What::Clock { at: None } => Command::SetClock(time_in(host.delay()).map_err(|year| {
            Failure::new(format!(
                "a recorder's clock runs from 1970 to 2069; this computer's says {year}"
            ))
            .hint("set this computer's clock, or give the time with --at")
        })?),
        // Nobody answers a broadcast, so a read does nothing but being noted.
        What::Mark => Command::Read { start: 1, count: 1 },
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

/// What a recorder last received as a broadcast, or why that is not known.
type Answer = std::result::Result<Option<LastBroadcast>, String>;

/// A recorder that was asked before the broadcast.
struct Asked {
    node: u8,
    unit: Unit,
    before: Answer,
    /// Where its log stood, if that is wanted and known.
    look: Option<LogLook>,
}

impl Asked {
    /// `looks` is where to remember what was seen in the log, if a look is wanted.
    fn before(
        host: &GeniHost,
        node: u8,
        connection: &ConnectionArgs,
        looks: Option<&StateArgs>,
    ) -> Asked {
        let mut unit = host.unit(node, connection::options(connection));
        // The same command may have been broadcast before.
        let before = last_broadcast(&mut unit);
        let look = looks.filter(|_| before.is_ok()).and_then(|state| {
            let look = LogLook::take(&mut unit).ok()?;
            let connection = connection::to_node(connection, node).ok()?;
            Some(look.named(
                || keeper::life_of_empty_log(state, &connection),
                || keeper::last_delivered(state, &connection),
            ))
        });
        Asked { node, unit, before, look }
    }

    /// Asks again, after a broadcast that was sent after `began`.
    fn check(&mut self, command: &Command, began: Duration) -> Check {
        let Asked { node, unit, before, look } = self;
        let after = last_broadcast(unit);
        let heard = Heard::of(command, before, &after);
        let known_at = unit.last_exchange().map_or(began, |exchange| exchange.carried_out().1);
        let total_after =
            look.and_then(|_| unit.log_position().ok()).map(|position| position.total);
        Check { node: *node, heard, after, look: *look, total_after, came: (began, known_at) }
    }
}

fn last_broadcast(unit: &mut Unit) -> Answer {
    unit.last_broadcast().map_err(|error| error.to_string())
}

/// Keeps that the clocks of these recorders were set, or may have been.
fn remember_set(
    connection: &ConnectionArgs,
    state: &StateArgs,
    checks: &[Check],
    time: TimeStamp,
) -> Result<()> {
    let how = How::Set { broadcast: Some(getrandom::u64().map_err(io::Error::from)?) };
    for check in checks {
        let record = match (check.heard, shown(&time)) {
            (Heard::Yes, Some(shown)) => check.observation(how, shown),
            (Heard::No, _) => continue,
            _ => setting::step(check.place()),
        };
        check.kept(connection, state)?.add(&[record]);
    }
    Ok(())
}

/// Whether a recorder has received a broadcast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    Yes,
    No,
    /// It did not say what it received, before or after, or it had received the very same before.
    NotKnown,
}

impl Heard {
    /// Judges by the last broadcast that the recorder received, before and after.
    fn of(command: &Command, before: &Answer, after: &Answer) -> Heard {
        let Ok(after) = after else { return Heard::NotKnown };
        let Some(last) = after.filter(|last| last.code == command.code().byte()) else {
            return Heard::No;
        };
        match before {
            Err(_) => Heard::NotKnown,
            Ok(before) if *before != Some(last) => Heard::Yes,
            // The recorder shows the time that was set, not the time at which it was set. The same
            // setting twice looks like one.
            Ok(_) if matches!(command, Command::SetClock(_)) => Heard::NotKnown,
            Ok(_) => Heard::No,
        }
    }
}

/// The result of the broadcast at one recorder: a row of the table.
pub(super) struct Check {
    pub(super) node: u8,
    pub(super) heard: Heard,
    pub(super) after: Answer,
    pub(super) look: Option<LogLook>,
    total_after: Option<u16>,
    /// Between which times of this computer the broadcast came, if it did.
    came: (Duration, Duration),
}

impl Check {
    /// The clock of the recorder showed this when the broadcast came.
    pub(super) fn observation(&self, how: How, shown: Moment<Shown>) -> Record {
        Record::Clock(setting::observation(how, shown, self.came, self.place()))
    }

    fn place(&self) -> Place {
        self.look.map_or(Place::UNKNOWN, |look| look.place(self.total_after))
    }

    /// What is kept of the recorder.
    pub(super) fn kept(
        &self,
        connection: &ConnectionArgs,
        state: &StateArgs,
    ) -> Result<KeptRecords> {
        KeptRecords::of(state, &connection::to_node(connection, self.node)?)
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heard = match self.heard {
            Heard::Yes => "yes",
            Heard::No => "no",
            Heard::NotKnown => "not known",
        };
        write!(f, "{:>4}  {heard:<9}  ", self.node)?;
        match &self.after {
            Ok(Some(last)) => last.fmt(f)?,
            Ok(None) => f.write_str("none since power-up")?,
            Err(why) => return f.write_str(why),
        }
        if self.heard == Heard::NotKnown {
            f.write_str(" (cannot be told from an earlier one)")?;
        }
        Ok(())
    }
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
    use super::*;

    const NOON: TimeStamp =
        TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 0 };

    fn last(code: u8, second: u8) -> Answer {
        Ok(Some(LastBroadcast { code, hour: 12, minute: 0, second, millisecond: 0 }))
    }

    fn silent() -> Answer {
        Err("no answer".to_string())
    }

    #[test]
    fn only_a_new_broadcast_of_this_command_counts() {
        for (before, after, heard) in [
            (Ok(None), last(0x45, 1), Heard::Yes),
            (last(0x45, 1), last(0x45, 2), Heard::Yes),
            (last(0x53, 1), last(0x45, 1), Heard::Yes),
            (last(0x45, 1), last(0x45, 1), Heard::No),
            (Ok(None), last(0x53, 1), Heard::No),
            (last(0x45, 1), Ok(None), Heard::No),
            (silent(), Ok(None), Heard::No),
        ] {
            assert_eq!(Heard::of(&Command::Erase, &before, &after), heard, "{before:?} {after:?}");
        }
    }

    #[test]
    fn without_an_answer_before_or_after_nothing_is_known() {
        for (before, after) in [
            (silent(), last(0x45, 1)),
            (last(0x45, 1), silent()),
            (silent(), silent()),
            (Ok(None), silent()),
        ] {
            assert_eq!(
                Heard::of(&Command::Erase, &before, &after),
                Heard::NotKnown,
                "{before:?} {after:?}"
            );
        }
    }

    #[test]
    fn the_same_time_set_twice_cannot_be_told_from_once() {
        let clock = Command::SetClock(NOON);
        let code = clock.code().byte();
        for (before, after, heard) in [
            (last(code, 0), last(code, 0), Heard::NotKnown),
            (last(code, 1), last(code, 0), Heard::Yes),
            (last(0x45, 0), last(code, 0), Heard::Yes),
            (last(code, 0), last(0x45, 0), Heard::No),
        ] {
            assert_eq!(Heard::of(&clock, &before, &after), heard, "{before:?} {after:?}");
        }
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
