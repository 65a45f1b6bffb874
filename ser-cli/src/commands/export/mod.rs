//! `export`: the entries of several recorders as a file for another program.

mod choice;
mod format;
mod write;

use std::path::PathBuf;

use ser_evidence::timeline::Timeline;

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};
use crate::gather::{self, SourceArgs};
use crate::outlet::file_named;
use choice::Choice;
use format::{CsvDialect, Data, Format};

const EXAMPLES: &str = "\
Examples:
  ser-cli export --input *.jsonl --format csv > all.csv
  ser-cli export --site plant.toml --last-trip --format comtrade -o trip.cfg
  ser-cli export --site plant.toml --format vcd -o plant.vcd
  ser-cli export --input u1.csv --format csv --csv-dialect excel-de > x.csv
  ser-cli export --site plant.toml --format prc002 --comname ACME -o reports

Without a choice of time everything is exported. Times without an offset are in the time zone of \
the site.
Every format says what is missing. What it cannot say is in a table in docs/formats.md.
With -o the file appears when it is whole, and not before: a full disk or Ctrl-C leaves nothing, \
and ends with exit code 1. An existing file is not overwritten without --force.";

/// Write the entries as a file for a spreadsheet, a database, a waveform viewer or an analysis.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The format of the file.
    #[arg(long, value_enum)]
    format: Format,

    /// The file, instead of standard output (-). comtrade writes .cfg, .dat and .hdr beside each
    /// other, under this name.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Name the file by IEEE C37.232 (COMNAME), with this company; -o is its folder.
    #[arg(long, value_name = "COMPANY", requires = "output")]
    comname: Option<String>,

    /// Overwrite existing files.
    #[arg(long, requires = "output")]
    force: bool,

    /// With csv: for which program; rfc4180 if not given.
    #[arg(long, value_enum, value_name = "DIALECT")]
    csv_dialect: Option<CsvDialect>,

    /// With csv and prc002: put an apostrophe before texts that a spreadsheet would take for a
    /// formula or a number.
    #[arg(long)]
    spreadsheet_safe: bool,

    /// With comtrade and cff: a row for every millisecond, for programs that know fixed rates only.
    /// At most an hour.
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u16).range(1000..=1000))]
    rate: Option<u16>,

    /// With comtrade and cff: how the rows are written; ascii if not given.
    #[arg(long, value_enum)]
    data: Option<Data>,

    /// With comtrade and cff: the line frequency that the file names, in hertz; 50 if not given.
    #[arg(long, value_name = "HZ", value_parser = line_frequency)]
    line_frequency: Option<u8>,

    /// End with exit code 3 if entries are known to be missing in the file.
    #[arg(long)]
    fail_on_loss: bool,

    #[command(flatten)]
    choice: Choice,

    #[command(flatten)]
    sources: SourceArgs,
}

impl Args {
    /// Where entries come from.
    pub(crate) const fn sources(&self) -> &SourceArgs {
        &self.sources
    }

    /// Whether the data goes to standard output.
    pub(crate) fn prints(&self) -> bool {
        file_named(self.output.as_deref()).is_none()
    }
}

fn line_frequency(text: &str) -> std::result::Result<u8, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("50 or 60".to_owned()),
    }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    fits(args)?;
    let destination = write::Destination::of(args, args.sources.files(connection))?;
    let gathered = gather::gather(&args.sources, connection, &|site| args.choice.which(site))?;
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    let selection = args.choice.selection(&timeline)?;
    let counted = write::write(args, destination, &gathered, &timeline, &selection)?;
    write::tell(counted);
    if !args.format.tells_damage() {
        write::tell_damaged(gathered.damaged);
    }
    if args.fail_on_loss {
        gathered.require_complete()?;
        if counted.losses > 0 {
            return Err(Failure::incomplete("entries are missing in the file"));
        }
    }
    Ok(())
}

/// Refuses options that the format does not have.
fn fits(args: &Args) -> Result<()> {
    let is_csv = args.format == Format::Csv;
    let is_comtrade = matches!(args.format, Format::Comtrade | Format::Cff);
    let is_table = is_csv || args.format == Format::Prc002;
    let of_others = [
        ("--csv-dialect", args.csv_dialect.is_some() && !is_csv, "csv"),
        ("--spreadsheet-safe", args.spreadsheet_safe && !is_table, "csv and prc002"),
        ("--rate", args.rate.is_some() && !is_comtrade, "comtrade and cff"),
        ("--data", args.data.is_some() && !is_comtrade, "comtrade and cff"),
        ("--line-frequency", args.line_frequency.is_some() && !is_comtrade, "comtrade and cff"),
    ];
    if let Some((option, _, formats)) = of_others.iter().find(|(_, is_wrong, _)| *is_wrong) {
        return Err(Failure::usage(format!("{option} is for --format {formats}"))
            .hint("leave it out, or choose that format"));
    }
    if args.format == Format::Comtrade && args.prints() {
        return Err(Failure::usage("comtrade is several files, and needs a name for them")
            .hint("give it with -o, as in -o trip.cfg")
            .hint("or write one file with --format cff"));
    }
    if args.comname.is_some() && args.prints() {
        return Err(Failure::usage("standard output has no name that --comname could give")
            .hint("with --comname, -o is the folder of the file"));
    }
    #[cfg(not(feature = "parquet"))]
    if args.format == Format::Parquet {
        return Err(Failure::usage("this ser-cli was built without Parquet")
            .hint("build it with it: cargo install --path ser-cli --features parquet")
            .hint("or export --format csv, which DuckDB and others turn into Parquet"));
    }
    Ok(())
}
