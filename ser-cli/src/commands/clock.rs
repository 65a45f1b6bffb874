//! `clock`: the recorder's clock.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use ser_evidence::record::{ClockObservation, Record};
use ser_observer::{
    LogLook,
    setting::{self, Setting, set_clock},
};
use ser_proto::TimeStamp;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, advise, inform, warn};
use crate::keeper::StateArgs;
use crate::kept::KeptRecords;
use crate::log_identity;
use crate::original::Originals;
use crate::output;
use crate::time::{local_time_in, parse_time, time_after};

const EXAMPLES: &str = "\
Examples:
  ser-cli clock set                               to the time of this computer
  ser-cli clock set --at 2026-11-22T10:00:00.250  to a given time
  ser-cli clock set --recorder U1-SER1            as the site file says
  ser-cli clock set --format jsonl >> log         for a report elsewhere

What the clock showed, and when, is remembered in the state directory, so that a report can tell \
how exact the recorder's times are. How exact the setting was is told on standard error. A \
recorder that can be asked for its clock is asked before and after, which takes a second.

Formats:
  text    the time that was sent
  jsonl   what was seen of the clock, an object per record (record \"clock\": \"set\", or \"query\" where \
it was asked; record \"step\" if nobody knows to what it was set), as read writes them";

/// Set the recorder's clock.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Set the clock; events that are already recorded keep their times.
    ///
    /// The time sent is the one at which the last byte arrives, so that the line adds no delay. The
    /// recorder knows no time zone and no daylight saving time. With --site it is set to what
    /// `clock` says there: UTC, the local time of the site, or an offset. The output shows the time
    /// that was sent.
    #[command(after_help = EXAMPLES)]
    Set {
        /// The time to set, as it will be when the last byte arrives; this computer's local time if
        /// not given.
        #[arg(long, value_name = "TIME", value_parser = parse_time)]
        at: Option<TimeStamp>,

        /// What is written to standard output.
        #[arg(long, value_enum, default_value_t)]
        format: Format,

        #[command(flatten)]
        state: StateArgs,
    },
}

/// What a command that sets or compares clocks writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people.
    #[default]
    Text,
    /// One JSON object per record: what was seen of the clocks.
    Jsonl,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let What::Set { at, format, state } = &args.what;
    let recorder = connection::recorder_name(connection)?;
    let tells = |records: &[Record]| match format {
        Format::Text => Ok(()),
        Format::Jsonl => {
            output::write_records(records.iter().map(|record| (recorder.as_str(), record)))
        }
    };
    let Set { sent, observed, records } =
        set_and_remember(*at, state, connection).or_else(|failed| {
            tells(&failed.records)?;
            Err(failed.failure)
        })?;
    if let (Some(setting), None) = (connection.clock_setting(), at) {
        inform(format_args!("set to {setting} time, as the site file says"));
    }
    match format {
        Format::Text => {
            let mut out = io::stdout().lock();
            writeln!(out, "{sent}")?;
            out.flush()?;
        }
        Format::Jsonl => tells(&records)?,
    }
    tell(observed.as_ref());
    Ok(())
}

/// A clock that may have been set, or not at all.
pub(super) struct NotSet {
    pub(super) failure: Failure,
    /// What was seen of the clock nevertheless.
    records: Vec<Record>,
}

impl<E: Into<Failure>> From<E> for NotSet {
    fn from(error: E) -> NotSet {
        NotSet { failure: error.into(), records: Vec::new() }
    }
}

/// A clock that was set.
pub(super) struct Set {
    /// The time that was sent.
    pub(super) sent: TimeStamp,
    /// What the clock showed when. `None` if the command was sent again and again: then nobody
    /// knows which attempt set it last.
    pub(super) observed: Option<ClockObservation>,
    /// Everything that was seen of the clock, in order.
    records: Vec<Record>,
}

/// Sets the clock to a given time or to the present, and remembers what that says of it.
pub(super) fn set_and_remember(
    at: Option<TimeStamp>,
    state: &StateArgs,
    connection: &ConnectionArgs,
) -> std::result::Result<Set, NotSet> {
    let setting = connection.clock_setting();
    let time_in = |ahead| match &setting {
        Some(setting) => setting.time_in(ahead),
        None => local_time_in(ahead),
    };
    // Checked before anything is sent. No download lasts from one century into the next.
    if at.is_none() {
        time_in(Duration::ZERO).map_err(|year| {
            Failure::new(format!(
                "a recorder's clock runs from 1970 to 2069; this computer's says {year}"
            ))
            .hint("set this computer's clock, or give the time with --at")
        })?;
    }
    let kept = KeptRecords::of(state, connection)?;
    let mut unit = connection::open(connection)?;
    // It says which life this is before the look at the log and with each answer after it.
    let identity = Originals::of(state, connection)?.identity(&mut unit)?;
    let look = LogLook::take(&mut unit)?;
    let life = identity.as_ref().map(|identity| identity.life);
    let before = log_identity::named(look, &mut unit, identity.as_ref(), (state, connection));
    let time_at = &mut time_at(at, &time_in);
    let Setting { sent, observed, records } = set_clock(&mut unit, &before, life, time_at);
    kept.add(&records);
    match sent {
        Ok(sent) => Ok(Set { sent, observed, records }),
        Err(error) => Err(NotSet { failure: error.into(), records }),
    }
}

/// The time to send so that it is right when it arrives that much later: the given one, or the
/// present.
fn time_at<'t>(
    at: Option<TimeStamp>,
    time_in: &'t dyn Fn(Duration) -> std::result::Result<TimeStamp, i32>,
) -> impl FnMut(Duration) -> TimeStamp + 't {
    let mut asked_first = None;
    move |ahead| match at {
        // A repeated attempt sets the time that has been reached since the first one.
        Some(at) => {
            let now = Instant::now();
            time_after(at, now.duration_since(*asked_first.get_or_insert(now)))
        }
        None => time_in(ahead).unwrap_or(setting::NO_TIME),
    }
}

/// Says how exact the setting was.
fn tell(observed: Option<&ClockObservation>) {
    match observed.map(setting::doubt_ms) {
        Some(Some(doubt_ms)) => inform(format_args!("exact to ± {doubt_ms} ms")),
        Some(None) => {}
        None => {
            warn(
                "the command was sent more than once, and it is not known which one set the clock",
            );
            advise(
                "set it once more, so that a report can tell how exact the recorder's times are",
            );
        }
    }
}
