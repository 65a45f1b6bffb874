//! `clock`: the recorder's clock.

use std::io::{self, Write};
use std::time::Instant;

use ser_proto::TimeStamp;

use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, inform};
use crate::time::{local_time_in, parse_time, time_after};

const EXAMPLES: &str = "\
Examples:
  ser-cli clock set                               to the time of this computer
  ser-cli clock set --at 2026-11-22T10:00:00.250  to a given time
  ser-cli clock set --recorder U1-SER1            as the site file says";

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
    },
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let What::Set { at } = args.what;
    let setting = connection.clock_setting();
    let time_in = |ahead| match &setting {
        Some(setting) => setting.time_in(ahead),
        None => local_time_in(ahead),
    };
    // Checked before anything is sent. No download lasts from one century into the next.
    if at.is_none() {
        time_in(std::time::Duration::ZERO).map_err(|year| {
            Failure::new(format!(
                "a recorder's clock runs from 1970 to 2069; this computer's says {year}"
            ))
            .hint("set this computer's clock, or give the time with --at")
        })?;
    }
    let mut unit = connection::open(connection)?;
    let mut asked_first = None;
    let sent = unit.set_clock(|ahead| match at {
        // A repeated attempt sets the time that has been reached since the first one.
        Some(at) => {
            let now = Instant::now();
            time_after(at, now.duration_since(*asked_first.get_or_insert(now)))
        }
        None => time_in(ahead).unwrap_or(NO_TIME),
    })?;
    if let (Some(setting), None) = (&setting, at) {
        inform(format_args!("set to {setting} time, as the site file says"));
    }
    let mut out = io::stdout().lock();
    writeln!(out, "{sent}")?;
    out.flush()?;
    Ok(())
}

/// Neither a recorder nor a client accepts this as a date.
const NO_TIME: TimeStamp =
    TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };
