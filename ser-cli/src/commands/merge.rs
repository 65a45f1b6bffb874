//! `merge`: the entries of several recorders in one list.

use std::io::{self, Write};

use clap::ValueEnum;
use ser_evidence::timeline::Timeline;
use ser_files::merged;

use super::report::styles;
use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};
use crate::gather::{self, SourceArgs};
use crate::output::{PROGRAM, Palette};

const EXAMPLES: &str = "\
Examples:
  ser-cli merge --site plant.toml                    read all recorders
  ser-cli merge --input u1.jsonl u2.jsonl --site plant.toml
  ser-cli merge --input *.csv --format csv > all.csv
  ser-cli merge --input *.jsonl --format jsonl > all.jsonl

Rows are in the order of what is known of the clocks, whatever the order of the sources. Neighbours \
in the table whose order is not known have a ~ in front.
Formats: csv has the columns of read, and recorder, utc, utc_earliest, utc_latest; jsonl holds all \
records, so that report and merge take it for the sources themselves.";

/// Put the entries of several recorders in one list, by what is known of their clocks.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The format of the list.
    #[arg(long, value_enum, default_value_t)]
    format: Format,

    /// End with exit code 3 if entries are known to be missing in the list.
    #[arg(long)]
    fail_on_loss: bool,

    #[command(flatten)]
    sources: SourceArgs,
}

/// The format of a list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Table,
    /// A row per change, with the recorder and the time in UTC.
    Csv,
    /// All records.
    Jsonl,
}

impl Args {
    /// Where entries come from.
    pub(crate) const fn sources(&self) -> &SourceArgs {
        &self.sources
    }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let gathered = gather::gather(&args.sources, connection, gather::EVERYTHING)?;
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    let mut out = io::BufWriter::with_capacity(1 << 18, io::stdout().lock());
    match args.format {
        Format::Table => {
            merged::write_table(&mut out, &timeline, styles(Palette::of_stdout()))?;
        }
        Format::Csv => merged::write_csv(&mut out, &timeline)?,
        Format::Jsonl => merged::write_jsonl(&mut out, &timeline, PROGRAM)?,
    }
    out.flush()?;
    if args.fail_on_loss {
        gathered.require_complete()?;
        let lives = gathered.history.recorders.iter().flat_map(|recorder| &recorder.lives);
        if lives.flat_map(|life| &life.gaps).next().is_some() {
            return Err(Failure::incomplete("the list has gaps"));
        }
    }
    Ok(())
}
