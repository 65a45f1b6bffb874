//! `diagnostics`: everything that the recorder counts.

mod growth;
mod shown;

use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use ser_client::Unit;
use ser_proto::{Capabilities, Identity};

use self::growth::{Growth, Look};
use self::shown::Shown;
pub(super) use self::shown::counters_json;
use crate::closed_stdout;
use crate::connection::{self, ConnectionArgs, HEARTBEAT, unless_unanswered};
use crate::error::{Failure, Result, inform, warn};
use crate::extension;
use crate::interrupt;
use crate::outage::Outage;
use crate::output::{Palette, json_to};
use crate::time::local_now;
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli diagnostics                all counters, and what each of them means
  ser-cli diagnostics --format json  for programs
  ser-cli diagnostics --every 10s    what grows from now on, until Ctrl-C

Counters count from the recorder's power-up and cannot be reset: so nobody takes away what somebody \
else is about to look at. --every shows how much each has grown since the look before. With --format \
json it writes an object on a line for each look, with all counters.

Original recorders count nothing that they could be asked for.";

/// Show what the recorder has counted since its power-up: what was lost, refused or repeated.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// How the counters are shown.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// Look again and again, so often, and show what has grown.
    #[arg(long, value_name = "TIME", value_parser = values::duration)]
    every: Option<Duration>,
}

/// How counters are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A row for each counter.
    #[default]
    Table,
    /// One JSON object.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    let identity =
        extension::require(&mut unit, connection, Capabilities::DIAGNOSTICS, "its counters")?;
    let look = look(&mut unit)?;
    match args.every {
        None => write(args.format, connection, &identity, &look),
        Some(every) => follow(args.format, every, connection, unit, &identity, look),
    }
}

fn look(unit: &mut Unit) -> Result<Look> {
    let counters = unit
        .recorder_counters()?
        .ok_or_else(|| Failure::new("the recorder does not tell its counters").hint("try again"))?;
    // The counters are there without it. It is asked for once, and a line may lose an answer.
    let looked = unless_unanswered(unit.clock_look())?.flatten();
    let tick_us = looked.map(|look| look.reading.tick_us);
    Ok(Look { counters, tick_us })
}

fn write(
    format: Format,
    connection: &ConnectionArgs,
    identity: &Identity,
    look: &Look,
) -> Result<()> {
    let (recorder, points) = (connection::recorder_name(connection)?, connection.points());
    let shown = Shown { recorder: &recorder, identity, points: &points };
    let mut out = io::stdout().lock();
    match format {
        Format::Table => shown.write_table(&mut out, &look.counters, Palette::of_stdout())?,
        Format::Json => json_to(&mut out, &shown.to_json(look, None))?,
    }
    Ok(out.flush()?)
}

/// Looks until an interrupt, or a failure that does not pass.
fn follow(
    format: Format,
    every: Duration,
    connection: &ConnectionArgs,
    mut unit: Unit,
    identity: &Identity,
    first: Look,
) -> Result<()> {
    let (recorder, points) = (connection::recorder_name(connection)?, connection.points());
    let shown = Shown { recorder: &recorder, identity, points: &points };
    let stop = interrupt::catch()?;
    let mut outage = Outage::new(connection::options(connection).timeout);
    match format {
        Format::Table => inform(format_args!(
            "what grows is shown from now on, every {} s, until Ctrl-C",
            every.as_secs_f64()
        )),
        Format::Json => write_line(&shown.to_json(&first, None))?,
    }
    let mut before = first;
    while wait(&mut unit, every, &stop, &mut outage)? {
        let now = match look(&mut unit) {
            Ok(now) => now,
            Err(failure) => {
                outage.bear(failure, Instant::now())?;
                continue;
            }
        };
        outage.end();
        let growth = Growth::between(&before, &now);
        if growth.began_anew {
            warn("the recorder was switched on again: its counters have begun anew");
        }
        match format {
            Format::Table => {
                let mut out = io::stdout().lock();
                shown.write_growth(&mut out, &growth, &local_now())?;
                out.flush()?;
            }
            Format::Json => write_line(&shown.to_json(&now, Some(&growth)))?,
        }
        before = now;
    }
    Ok(())
}

fn write_line(json: &serde_json::Value) -> Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{json}")?;
    Ok(out.flush()?)
}

/// Waits for the next look; false at an interrupt, or when nobody reads any more. Reports that come meanwhile are for others.
fn wait(unit: &mut Unit, every: Duration, stop: &AtomicBool, outage: &mut Outage) -> Result<bool> {
    let until = Instant::now() + every;
    loop {
        if stop.load(Ordering::Relaxed) || closed_stdout::reader_is_gone() {
            return Ok(false);
        }
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(true);
        }
        if let Err(error) = unit.wait_event(left.min(HEARTBEAT)) {
            outage.bear(error.into(), Instant::now())?;
            std::thread::sleep(HEARTBEAT);
        }
    }
}
