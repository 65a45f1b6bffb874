//! `time`: how far the clocks of recorders are from this computer's.

mod ask;
mod drift;
mod show;

use std::io;
use std::thread;
use std::time::Duration;

use clap::ValueEnum;
use ser_observer::host_reading;

use crate::buses::Buses;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result, advise};
use crate::interrupt::Caught;
use crate::keeper::StateArgs;
use crate::output;
use crate::values;
use ask::{Answer, Asking};
use show::{HostDoubt, Row};

const EXAMPLES: &str = "\
Examples:
  ser-cli time --port /dev/ttyUSB0          one recorder
  ser-cli time --site north.toml            all recorders of a site
  ser-cli time --for 60s                    look for a minute, for the drift
  ser-cli time --format json                for programs
  ser-cli time --format jsonl >> log        as records, for a report

Each recorder is asked several times what its clock shows, and nothing is set. The clock is \
compared with this computer's in the zone that the site file says (`clock`), without a site file in \
the local time of this computer. + is ahead, and ± what is not known: the way there and back. The \
drift is + for a clock that is fast. It is known from earlier looks that this computer remembers, \
since the clock was last set, or from a look that is long enough (--for).

Original recorders cannot be asked for their clocks: ser-cli clock set sets them to a known time, \
and on a Genius bus ser-cli genius broadcast mark compares them. The exit code is 0 if any clock was \
told.";

/// Show how far the clocks of recorders are from this computer's clock.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// For how long to ask; if not given, half a second.
    #[arg(long = "for", value_name = "TIME", value_parser = values::duration)]
    time: Option<Duration>,

    /// What is written to standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    #[command(flatten)]
    state: StateArgs,
}

/// What is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Table,
    /// One JSON object.
    Json,
    /// One JSON object per record: what was seen of the clocks.
    Jsonl,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let rows = match &connection.chosen {
        Some(chosen) if connection::ports(connection).is_empty() => {
            let reached = chosen.with_ports();
            let recorders: Vec<(String, ConnectionArgs)> = reached
                .filter_map(|(id, _)| {
                    let name = chosen.site.recorders.get(id.0)?.name.clone();
                    Some((name, chosen.reached(connection, id)?))
                })
                .collect();
            if recorders.is_empty() {
                return Err(chosen.which());
            }
            ask_all(args, recorders)?
        }
        _ => vec![ask_one(args, connection)?],
    };
    let doubt = host_doubt(connection);
    let mut out = io::stdout().lock();
    match args.format {
        Format::Table => show::table(&mut out, &rows, doubt)?,
        Format::Json => show::json(&mut out, &rows, doubt)?,
        Format::Jsonl => {
            drop(out);
            let told = rows.iter().filter_map(|(name, answer)| match answer {
                Ok(Answer::Told(told)) => Some((name.as_str(), &told.records)),
                _ => None,
            });
            output::write_records(
                told.flat_map(|(name, records)| records.iter().map(move |record| (name, record))),
            )?;
        }
    }
    conclude(&rows)
}

/// One recorder. That it cannot be reached is a failure as of any command.
fn ask_one(args: &Args, connection: &ConnectionArgs) -> Result<Row> {
    let caught = Caught::for_now()?;
    let buses = Buses::default();
    let asking = asking(args, &buses, &caught);
    Ok((connection::recorder_name(connection)?, Ok(asking.ask(connection)?)))
}

/// All recorders of a site, at once.
fn ask_all(args: &Args, recorders: Vec<(String, ConnectionArgs)>) -> Result<Vec<Row>> {
    let caught = Caught::for_now()?;
    let buses = Buses::default();
    let asking = &asking(args, &buses, &caught);
    let ask =
        |connection: ConnectionArgs| asking.ask(&connection).map_err(|failure| failure.message());
    let ask = &ask;
    Ok(thread::scope(|scope| {
        let running: Vec<_> = recorders
            .into_iter()
            .map(|(name, connection)| (name, scope.spawn(move || ask(connection))))
            .collect();
        let panicked = |panic| std::panic::resume_unwind(panic);
        running
            .into_iter()
            .map(|(name, thread)| (name, thread.join().unwrap_or_else(panicked)))
            .collect()
    }))
}

fn asking<'a>(args: &'a Args, buses: &'a Buses, caught: &'a Caught) -> Asking<'a> {
    let time = args.time.unwrap_or_default();
    Asking { state: &args.state, buses, time, stop: caught.flag() }
}

/// What the operating system says of this computer's clock, else what the site file says.
fn host_doubt(connection: &ConnectionArgs) -> HostDoubt {
    let by_system = host_reading::now().utc_doubt_us.map(|us| (us, "the operating system"));
    let site = connection.chosen.as_deref().and_then(|chosen| chosen.site.utc_doubt_us);
    by_system.or(site.map(|us| (us, "the site file")))
}

/// Says what to do about those that told nothing, and fails if none did.
fn conclude(rows: &[Row]) -> Result<()> {
    let is_told = |(_, answer): &Row| matches!(answer, Ok(Answer::Told(_)));
    let is_original = |(_, answer): &Row| matches!(answer, Ok(Answer::Original));
    let what_else = [
        "ser-cli clock set sets the clock of an original recorder to a known time",
        "on a Genius bus, ser-cli genius broadcast mark compares clocks without setting any",
    ];
    if !rows.iter().any(is_told) {
        let failure = Failure::new("no recorder has told what its clock shows");
        return Err(match rows.iter().any(is_original) {
            true => what_else.into_iter().fold(failure, Failure::hint),
            false => failure.hint("ser-cli status shows whether a recorder works"),
        });
    }
    if rows.iter().any(is_original) {
        what_else.iter().for_each(advise);
    }
    Ok(())
}
