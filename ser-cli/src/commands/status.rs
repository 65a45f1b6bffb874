//! `status`: what the recorder is doing.

mod clock;
mod facts;
mod json;
mod text;

use std::io::{self, Write};

use clap::ValueEnum;
use ser_console::Harmless;

use self::facts::Facts;
use self::text::Names;
use crate::connection::{self, ConnectionArgs};
use crate::error::{Result, advise};
use crate::output::{Palette, field, json_to};
use crate::site_file::Chosen;

const EXAMPLES: &str = "\
Examples:
  ser-cli status --port /dev/ttyUSB0
  ser-cli status --port tcp://10.0.0.7:4000 --timeout 5s
  ser-cli status --format json              for programs

A recorder with our firmware also tells who it is, what its clock shows and how far that is from \
this computer's time (or from what `clock` in the site file says), what it filters out, and whether \
it has lost anything: filter and diagnostics show the rest. The offset is measured in several \
questions; it holds for this computer's clock, whatever that is worth: ser-cli time says more.";

/// Ask the recorder what it is doing: recording or not, log, settings, latest event, clock.
///
/// Original recorders answer only some of this; the rest is shown as not known.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// How the status is shown.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// How a status is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A line for each fact.
    #[default]
    Text,
    /// One JSON object; what the recorder does not say is null.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut unit = connection::open(connection)?;
    let facts = Facts::of(&mut unit, connection)?;
    let points = connection.points();
    let mut out = io::stdout().lock();
    match args.format {
        Format::Text => {
            if let Some(chosen) = &connection.chosen {
                write_names(&mut out, chosen)?;
            }
            let names = Names { points: &points, palette: Palette::of_stdout() };
            text::write(&mut out, &facts, &names)?;
        }
        Format::Json => {
            let recorder = connection::recorder_name(connection)?;
            json_to(&mut out, &json::status(&facts, &recorder, &points))?;
        }
    }
    out.flush()?;
    if facts.mode.is_none() {
        advise(
            "mode and settings are not known: an original recorder does not answer the queries \
             for them, nor those for identity, clock, filters and counters",
        );
    }
    Ok(())
}

/// The names of site and recorder.
fn write_names(out: &mut dyn Write, chosen: &Chosen) -> io::Result<()> {
    let Some(recorder) = chosen.recorder() else { return Ok(()) };
    field(out, "site", Harmless(&chosen.site.name).line())?;
    field(out, "recorder", Harmless(&recorder.name).line())
}
