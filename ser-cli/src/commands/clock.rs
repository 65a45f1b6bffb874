//! `clock`: the recorder's clock.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use ser_client::{RequestError, Unit};
use ser_evidence::record::{ClockObservation, How, Record};
use ser_evidence::time::shown;
use ser_proto::TimeStamp;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, advise, inform, warn};
use crate::keeper::{self, StateArgs};
use crate::kept::KeptRecords;
use crate::log_look::LogLook;
use crate::setting;
use crate::time::{local_time_in, parse_time, time_after};

const EXAMPLES: &str = "\
Examples:
  ser-cli clock set                               to the time of this computer
  ser-cli clock set --at 2026-11-22T10:00:00.250  to a given time
  ser-cli clock set --recorder U1-SER1            as the site file says

What the clock showed, and when, is remembered in the state directory, so that a report can tell \
how exact the recorder's times are. How exact the setting was is told on standard error.";

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

        #[command(flatten)]
        state: StateArgs,
    },
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let What::Set { at, state } = &args.what;
    let Set { sent, observed } = set_and_remember(*at, state, connection)?;
    if let (Some(setting), None) = (connection.clock_setting(), at) {
        inform(format_args!("set to {setting} time, as the site file says"));
    }
    let mut out = io::stdout().lock();
    writeln!(out, "{sent}")?;
    out.flush()?;
    tell(observed.as_ref());
    Ok(())
}

/// A clock that was set.
pub(super) struct Set {
    /// The time that was sent.
    pub(super) sent: TimeStamp,
    /// What the clock showed when. `None` if the command was sent again and again: then nobody knows
    /// which attempt set it last.
    pub(super) observed: Option<ClockObservation>,
}

/// Sets the clock to a given time or to the present, and remembers what that says of it.
pub(super) fn set_and_remember(
    at: Option<TimeStamp>,
    state: &StateArgs,
    connection: &ConnectionArgs,
) -> Result<Set> {
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
    let before = LogLook::take(&mut unit)?.named(
        || keeper::life_of_empty_log(state, connection),
        || keeper::last_delivered(state, connection),
    );
    let sent = set(&mut unit, at, &time_in).inspect_err(|error| {
        if matches!(error, RequestError::NoReply { may_have_been_done: true, .. }) {
            kept.add(&[setting::step(before.place(None))]);
        }
    })?;
    let observed = observed(&mut unit, sent, &before);
    kept.add(&[observed.map_or_else(|| setting::step(before.place(None)), Record::Clock)]);
    Ok(Set { sent, observed })
}

fn set(
    unit: &mut Unit,
    at: Option<TimeStamp>,
    time_in: &dyn Fn(Duration) -> std::result::Result<TimeStamp, i32>,
) -> std::result::Result<TimeStamp, RequestError> {
    let mut asked_first = None;
    unit.set_clock(|ahead| match at {
        // A repeated attempt sets the time that has been reached since the first one.
        Some(at) => {
            let now = Instant::now();
            time_after(at, now.duration_since(*asked_first.get_or_insert(now)))
        }
        None => time_in(ahead).unwrap_or(NO_TIME),
    })
}

/// What the clock showed when it was set just now.
fn observed(unit: &mut Unit, sent: TimeStamp, before: &LogLook) -> Option<ClockObservation> {
    let exchange = unit.last_exchange().filter(|exchange| exchange.attempts == 1)?;
    let after = unit.log_position().ok().map(|position| position.total);
    let how = How::Set { broadcast: None };
    Some(setting::observation(how, shown(&sent)?, exchange.carried_out(), before.place(after)))
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

/// Neither a recorder nor a client accepts this as a date.
const NO_TIME: TimeStamp =
    TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };
