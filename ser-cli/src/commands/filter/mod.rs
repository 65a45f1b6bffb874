//! `filter`: what the recorder filters out at its inputs.

mod set;
mod shown;
mod values;

use std::io::{self, Write};

use clap::ValueEnum;
use ser_client::Unit;
use ser_proto::{Capabilities, InputFilter};

use self::set::Target;
pub(super) use self::shown::Shown;
use self::values::{Chatter, Wish};
use crate::audit::AuditArgs;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Failure, Result};
use crate::extension;
use crate::output::{Palette, json_to};

const EXAMPLES: &str = "\
Examples:
  ser-cli filter                                  the filters of all inputs
  ser-cli filter --format json                    for programs
  ser-cli filter set --input all --debounce 5ms
  ser-cli filter set --input 3 --chatter 10/1s --rearm 2s
  ser-cli filter set --input 1-4,7 --chatter off  record every change again
  ser-cli filter clear --input 3                  no filter at all

A debounce time says how long an input has to hold a new state until the change counts; the entry \
still has the time of its first moment. An input that chatters, with so many changes within the \
window, is left out of the log until it has been quiet for the re-arm time. Its changes are counted \
meanwhile, and the count is shown here, by status, read, watch and report.

The recorder keeps its filters with its settings: they hold over power cycles. Until the first one \
is set, the board decides the debounce times. Original recorders have no filters that can be asked \
for or set over the line.";

const SET_EXAMPLES: &str = "\
Examples:
  ser-cli filter set --input 3 --debounce 5ms --chatter 10/1s --rearm 2s
  ser-cli filter set --input all --debounce off
  ser-cli filter set --point \"52-1 closed\" --debounce 8ms

Ranges:
  debounce  0ms to 255ms; off is 0ms
  chatter   5 to 32 changes, and more than 4 for each second of the window that
            has begun, so that an input that operates twice a second is never
            left out; a window of 1ms to 7000ms
  re-arm    the window or longer, up to 65.535s

What is not given stays as it is. The recorder keeps its filters over power cycles. The output shows \
all filters that are in force afterwards.";

/// Show or change what the recorder filters out at its inputs: bounces and chatter.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, subcommand_negates_reqs = true)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: Option<What>,

    /// How the filters are shown.
    #[arg(long, global = true, value_enum, default_value_t)]
    format: Format,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Set filters; what is not given stays as it is.
    #[command(
        after_help = SET_EXAMPLES,
        group = clap::ArgGroup::new("change").args(["debounce", "chatter", "rearm"]).multiple(true).required(true),
    )]
    Set {
        #[command(flatten)]
        target: Target,

        /// How long an input must hold a new state until the change counts: 5ms, off.
        #[arg(long, value_name = "TIME", value_parser = values::debounce)]
        debounce: Option<u8>,

        /// From how many changes in which time on an input is left out: 10/1s, off.
        #[arg(long, value_name = "N/TIME", value_parser = values::chatter)]
        chatter: Option<Chatter>,

        /// How long an input that chatters must be quiet until it is believed again; if not given,
        /// as before, or twice the window where there was no chatter filter.
        #[arg(long, value_name = "TIME", value_parser = values::rearm)]
        rearm: Option<u16>,

        #[command(flatten)]
        audit: AuditArgs,
    },

    /// Switch filters off: every change counts at once.
    #[command(after_help = EXAMPLES)]
    Clear {
        #[command(flatten)]
        target: Target,

        #[command(flatten)]
        audit: AuditArgs,
    },
}

/// How filters are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A row for each input.
    #[default]
    Table,
    /// One JSON object.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let (target, wish) = match &args.what {
        None => return show(args.format, connection),
        Some(What::Set { target, debounce, chatter, rearm, .. }) => {
            let wish = Wish { debounce_ms: *debounce, chatter: *chatter, rearm_ms: *rearm };
            (target, wish)
        }
        Some(What::Clear { target, .. }) => {
            let off = Some(Chatter::Off);
            (target, Wish { debounce_ms: Some(0), chatter: off, rearm_ms: None })
        }
    };
    // Checked before anything is sent, as far as that does not need the recorder.
    let inputs = target.inputs(&connection.points(), connection.chosen.is_some())?;
    let mut unit = connection::open(connection)?;
    let (model, now) = filters(&mut unit, connection)?;
    let in_force = set::set(&mut unit, &inputs.of(model)?, wish, &now, &connection.points())?;
    write(args.format, &mut unit, connection, &in_force)
}

fn show(format: Format, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    let (_, filters) = filters(&mut unit, connection)?;
    write(format, &mut unit, connection, &filters)
}

/// The recorder's model and all its filters.
fn filters(
    unit: &mut Unit,
    connection: &ConnectionArgs,
) -> Result<(ser_proto::Model, Vec<InputFilter>)> {
    let identity = extension::require(unit, connection, Capabilities::FILTERS, "its filters")?;
    let filters = unit
        .filters()?
        .ok_or_else(|| Failure::new("the recorder does not tell its filters").hint("try again"))?;
    Ok((identity.model, filters))
}

fn write(
    format: Format,
    unit: &mut Unit,
    connection: &ConnectionArgs,
    filters: &[InputFilter],
) -> Result<()> {
    let counters = unit.recorder_counters()?.unwrap_or_default();
    let (recorder, points) = (connection::recorder_name(connection)?, connection.points());
    let shown = Shown { recorder: &recorder, filters, points: &points, counters: &counters };
    let mut out = io::stdout().lock();
    match format {
        Format::Table => shown.write_table(&mut out, Palette::of_stdout())?,
        Format::Json => json_to(&mut out, &shown.to_json())?,
    }
    Ok(out.flush()?)
}
