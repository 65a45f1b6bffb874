//! Whether a recorder has received a broadcast: what it says of the last one, before and after.

use std::fmt;
use std::time::Duration;

use ser_client::{GeniHost, Unit};
use ser_evidence::record::{How, Place, Record};
use ser_evidence::time::{Moment, Shown};
use ser_observer::{LogLook, setting};
use ser_proto::{Capabilities, ClockReading, Command, LastBroadcast, Mark};

use crate::connection::{self, ConnectionArgs};
use crate::error::Result;
use crate::keeper::StateArgs;
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;

/// What a recorder last received as a broadcast, or why that is not known.
pub(super) type Answer = std::result::Result<Option<LastBroadcast>, String>;

/// How often a recorder is asked for its clock. The mark that it has kept stays the same.
const ASKED_FOR_MARK: usize = 3;

/// A recorder that was asked before the broadcast.
pub(super) struct Asked {
    node: u8,
    unit: Unit,
    before: Answer,
    /// Where its log stood, if that is wanted and known.
    look: Option<LogLook>,
    /// Whether it can be asked for its clock.
    tells_clock: bool,
}

impl Asked {
    /// `looks` is where to remember what was seen in the log, if a look is wanted.
    pub(super) fn before(
        host: &GeniHost,
        node: u8,
        connection: &ConnectionArgs,
        looks: Option<&StateArgs>,
    ) -> Asked {
        let to_node = connection::to_node(connection, node).ok();
        let mut unit = connection::on_bus(host, node, to_node.as_ref().unwrap_or(connection));
        // The same command may have been broadcast before.
        let before = last_broadcast(&mut unit);
        let connection = to_node;
        let wanted = looks.zip(connection).filter(|_| before.is_ok());
        let look = wanted.as_ref().and_then(|_| LogLook::take(&mut unit).ok());
        let identity = wanted.as_ref().and_then(|(state, connection)| {
            Originals::of(state, connection).ok()?.identity(&mut unit).ok()?
        });
        let look = look.zip(wanted).map(|(look, (state, connection))| {
            log_identity::named(look, &mut unit, identity.as_ref(), (state, &connection))
        });
        let tells_clock =
            identity.is_some_and(|identity| identity.capabilities.contains(Capabilities::TIME));
        Asked { node, unit, before, look, tells_clock }
    }

    /// Whether it can be asked for its clock. Only such a recorder knows a mark with a token, and
    /// no other one must get it.
    pub(super) const fn tells_clock(&self) -> bool {
        self.tells_clock
    }

    /// Asks again, after a broadcast that was sent after `began`.
    pub(super) fn check(&mut self, command: &Command, began: Duration) -> Check {
        let Asked { node, unit, before, look, tells_clock } = self;
        let after = last_broadcast(unit);
        let mut heard = Heard::of(command, before, &after);
        let known_at = unit.last_exchange().map_or(began, |exchange| exchange.carried_out().1);
        let asks_clock =
            *tells_clock && matches!(command, Command::Read { .. } | Command::Time { .. });
        let clock = if asks_clock { clock(unit) } else { None };
        let mut mark = None;
        if let Command::Time { token } = *command {
            heard = Heard::of_mark(token, clock.as_ref());
            mark = clock.and_then(|clock| clock.last_mark).filter(|mark| mark.token == token);
        }
        let total_after =
            look.and_then(|_| unit.log_position().ok()).map(|position| position.total);
        let came = (began, known_at);
        Check { node: *node, heard, after, look: *look, total_after, came, mark, clock }
    }
}

fn clock(unit: &mut Unit) -> Option<ClockReading> {
    let look = (0..ASKED_FOR_MARK).find_map(|_| unit.clock_look().ok());
    look.flatten().map(|look| look.reading)
}

fn last_broadcast(unit: &mut Unit) -> Answer {
    unit.last_broadcast().map_err(|error| error.to_string())
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
    /// Judges by the mark that the recorder has kept.
    fn of_mark(token: u16, clock: Option<&ClockReading>) -> Heard {
        match clock.map(|clock| clock.last_mark) {
            None => Heard::NotKnown,
            Some(Some(mark)) if mark.token == token => Heard::Yes,
            Some(_) => Heard::No,
        }
    }

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
    pub(super) total_after: Option<u16>,
    /// Between which times of this computer the broadcast came, if it did.
    pub(super) came: (Duration, Duration),
    /// The mark that it was, if it was one with a token and the recorder has received it.
    pub(super) mark: Option<Mark>,
    /// What its clock showed afterwards, if it was asked.
    pub(super) clock: Option<ClockReading>,
}

impl Check {
    /// The clock of the recorder showed this when the broadcast came.
    pub(super) fn observation(&self, how: How, shown: Moment<Shown>) -> Record {
        Record::Clock(setting::observation(how, shown, self.came, self.place()))
    }

    pub(super) fn place(&self) -> Place {
        self.look.map_or(Place::UNKNOWN, |look| look.place(self.total_after))
    }

    /// The recorder's name in records: that of the site file, if it has the port.
    pub(super) fn name(&self, connection: &ConnectionArgs) -> Result<String> {
        let connection = connection::to_node(connection, self.node)?;
        let unit = connection::unit_name(&connection)?;
        let known = connection.chosen.as_deref().and_then(|chosen| chosen.name_at(&unit));
        Ok(known.unwrap_or(unit.name))
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

#[cfg(test)]
mod tests {
    use super::*;

    const NOON: ser_proto::TimeStamp = ser_proto::TimeStamp {
        year: 26,
        month: 11,
        day: 22,
        hour: 12,
        minute: 0,
        second: 0,
        millisecond: 0,
    };

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
    fn a_mark_was_received_if_it_is_the_one_that_is_kept() {
        let clock = |last_mark| ClockReading {
            token: 1,
            clock_us: 0,
            source: ser_proto::ClockSource::NeverSet,
            age_s: 0,
            doubt_us: None,
            drift_ppb: None,
            tick_us: 0,
            life: 1,
            next_sequence: 1,
            last_mark,
        };
        let marked = clock(Some(ser_proto::Mark { token: 7, clock_us: 5 }));
        assert_eq!(Heard::of_mark(7, Some(&marked)), Heard::Yes);
        assert_eq!(Heard::of_mark(8, Some(&marked)), Heard::No);
        assert_eq!(Heard::of_mark(7, Some(&clock(None))), Heard::No);
        assert_eq!(Heard::of_mark(7, None), Heard::NotKnown);
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
}
