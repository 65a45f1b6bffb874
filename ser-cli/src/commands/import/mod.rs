//! `import`: lists of other recorders and relays become files that `report` and `merge` take.

mod files;
mod telling;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use ser_evidence::record::Record;
use ser_evidence::site::Site;
use ser_files::import::{DateOrder, Epoch, Format, Importer, Map, Options, Output, zone_named};

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};
use crate::new_files::NewFiles;
use crate::outlet::{NotWritten, Outlet, file_named};
use crate::output::PROGRAM;
use crate::site_file;

const EXAMPLES: &str = "\
Examples:
  ser-cli import f3.txt --zone Europe/Berlin -o f3.jsonl
  ser-cli import f3.txt --zone -06:00 --dates mdy -o f3.jsonl
  ser-cli import monday.txt tuesday.txt --recorder F3 --zone UTC -o f3.jsonl
  ser-cli import record.cfg -o record.jsonl     COMTRADE, with record.dat
  ser-cli import f3.txt --zone UTC --map f3.toml -o f3.jsonl
  ser-cli report --site plant.toml --input f3.jsonl ours.jsonl

The format is known by the content. What a list does not say is asked for and never guessed: its \
time zone, the order of its dates. A line that is not understood is told with its reason, and the \
rest is read. What each format holds, and what is lost, is in docs/formats.md.
A map gives a name of the list an input, or a point of the site file (--site), and says which of its \
words means on:
  [[point]]
  from = \"87T\"
  input = 3
  on = \"TRIPPED\"";

/// Make the list of a relay or of another recorder a file for `report` and `merge`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The files. All files of one recorder belong in one import, with --recorder: what is in
    /// several of them is there once.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// The format of the files.
    #[arg(long, value_enum, default_value_t)]
    format: GivenFormat,

    /// The file to write; standard output if not given, or with -.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Overwrite the file if it exists.
    #[arg(long, requires = "output")]
    force: bool,

    /// The time zone of times without one: Europe/Berlin, UTC, +05:30.
    #[arg(long, value_name = "ZONE", value_parser = parse_zone, allow_hyphen_values = true)]
    zone: Option<jiff::tz::TimeZone>,

    /// The order of dates, where they leave it open.
    #[arg(long, value_enum)]
    dates: Option<Dates>,

    /// From when `CyTime` counts seconds: 1970 in UTC if /posix/ was in the address, else 1984 in local
    /// time.
    #[arg(long, value_enum)]
    epoch: Option<GivenEpoch>,

    /// How far the clock may have been from UTC, in milliseconds. Without it nothing is known.
    #[arg(long, value_name = "MS", value_parser = parse_doubt)]
    doubt_ms: Option<u32>,

    /// A file that says which input a name is, and what its words mean; see below.
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,

    /// End with exit code 3 if a line was not understood, or if a file shows that something is missing.
    #[arg(long)]
    fail_on_loss: bool,
}

/// The format of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum GivenFormat {
    /// By the content.
    #[default]
    Auto,
    /// CSV of ser-cli.
    Csv,
    /// JSON lines of ser-cli.
    Jsonl,
    /// What the command SER of an SEL relay prints.
    SelSer,
    /// What the command CSER of an SEL relay gives.
    SelCser,
    /// Answers of a `CyTime` recorder's web server.
    Cytime,
    /// A .cfg with its .dat beside it, or a .cff.
    Comtrade,
    /// CSV as asked for with NERC PRC-002.
    Prc002,
}

/// The order of dates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Dates {
    /// Month, day, year.
    Mdy,
    /// Day, month, year.
    Dmy,
    /// Year, month, day.
    Ymd,
}

/// From when seconds count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum GivenEpoch {
    /// 1970, in UTC.
    Posix,
    /// 1984, in the recorder's local time.
    #[value(name = "1984")]
    Local1984,
}

impl Args {
    /// Whether the data goes to standard output.
    pub(crate) fn prints(&self) -> bool {
        file_named(self.output.as_deref()).is_none()
    }
}

fn parse_zone(text: &str) -> std::result::Result<jiff::tz::TimeZone, String> {
    zone_named(text).ok_or_else(|| {
        "not a time zone like Europe/Berlin or UTC, nor an offset like +05:30".to_owned()
    })
}

fn parse_doubt(text: &str) -> std::result::Result<u32, String> {
    /// A day.
    const MOST_MS: u32 = 86_400_000;
    let doubt_ms = text.parse().ok().filter(|doubt_ms| *doubt_ms <= MOST_MS);
    doubt_ms.ok_or_else(|| format!("a whole number of milliseconds from 0 to {MOST_MS} is needed"))
}

/// Refuses options that say nothing about files of our own: these say it themselves.
fn fits(path: &Path, format: Format, args: &Args, recorder: Option<&str>) -> Result<()> {
    if !is_own(format) {
        return Ok(());
    }
    let given = [
        ("--zone", args.zone.is_some()),
        ("--dates", args.dates.is_some()),
        ("--epoch", args.epoch.is_some()),
        ("--doubt-ms", args.doubt_ms.is_some()),
        ("--map", args.map.is_some()),
        // A table does not name its recorder.
        ("--recorder", recorder.is_some() && format == Format::Jsonl),
    ];
    match given.iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => Err(Failure::usage(format!(
            "{option} does nothing for {}, which is {format}",
            path.display()
        ))
        .hint(format!("leave {option} out, or import the lists that need it by themselves"))),
        None => Ok(()),
    }
}

const fn is_own(format: Format) -> bool {
    matches!(format, Format::Csv | Format::Jsonl)
}

/// Refuses to give the list of another device to a recorder that is read: that one has a log of its
/// own, and its stamps are not those of the list.
fn is_not_read(name: &str, format: Format, site: Option<&Site>) -> Result<()> {
    let recorder = site.and_then(|site| Some((site, site.recorder(name)?)));
    let port = recorder.and_then(|(site, id)| site.recorders.get(id.0)?.port.as_deref());
    match port.filter(|_| !is_own(format)) {
        Some(port) => Err(Failure::usage(format!(
            "{name} is a recorder of the site that is read at {port}, and no list of another device \
             can be its log"
        ))
        .hint("name the device with --recorder, and give it a [[recorder]] without a port")
        .hint("say same_as of points that watch one contact")),
        None => Ok(()),
    }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let mut inputs = files::with_data(&args.files);
    inputs.extend(args.map.iter().chain(&connection.site).cloned());
    let new = NewFiles::new(args.force).sparing(inputs);
    let outlet = Outlet::open(file_named(args.output.as_deref()), new)?;
    let site = connection.site.as_deref().map(site_file::load).transpose()?;
    let importer = Importer::new(options(args, site.as_ref())?);
    let recorder = connection.recorder.as_deref();
    let (left_out, lost) =
        outlet.write(|out| import(args, recorder, site.as_ref(), importer, out))?;
    match (left_out, lost) {
        (1.., _) if args.fail_on_loss => Err(Failure::incomplete("not all lines were understood")),
        (_, 1..) if args.fail_on_loss => {
            Err(Failure::incomplete("something is missing in the files"))
        }
        _ => Ok(()),
    }
}

/// Reads all files, and writes what they become. Returns how many lines were left out, and at how
/// many places something is lost.
fn import(
    args: &Args,
    recorder: Option<&str>,
    site: Option<&Site>,
    mut importer: Importer,
    out: &mut (dyn Write + Send),
) -> std::result::Result<(u64, u64), NotWritten> {
    let mut output = Output::new(out, PROGRAM);
    let (mut left_out, mut lost) = (0, 0);
    for path in &files::without_data(&args.files) {
        let mut own = |recorder: &str, record: &Record, note: Option<&str>| {
            output.record(recorder, record, note)
        };
        // Before the rest is read, which may take a while.
        let fits = |format| {
            fits(path, format, args, recorder)?;
            is_not_read(recorder.unwrap_or(&files::stem(path)), format, site)
        };
        let read = files::read(&mut importer, path, recorder, fits, &mut own)?;
        left_out += read.notes.left_out_count;
        lost += read.notes.lost_count;
        telling::file(path, &read);
    }
    let imported = importer.finish();
    left_out += imported.notes.left_out_count;
    telling::all(&imported, left_out);
    match output.finish(&imported)? {
        true => Ok((left_out, lost)),
        false => Err(Failure::new("there is nothing in these files that could be written")
            .hint("is the list empty? Then there is nothing to import")
            .hint("--format says what the files are, if they were taken for something else")
            .into()),
    }
}

fn options(args: &Args, site: Option<&Site>) -> Result<Options> {
    let map = match &args.map {
        Some(path) => files::map(path, site)?,
        None => Map::default(),
    };
    Ok(Options {
        format: match args.format {
            GivenFormat::Auto => None,
            GivenFormat::Csv => Some(Format::Csv),
            GivenFormat::Jsonl => Some(Format::Jsonl),
            GivenFormat::SelSer => Some(Format::SelSer),
            GivenFormat::SelCser => Some(Format::SelCser),
            GivenFormat::Cytime => Some(Format::Cytime),
            GivenFormat::Comtrade => Some(Format::Comtrade),
            GivenFormat::Prc002 => Some(Format::Prc002),
        },
        zone: args.zone.clone(),
        dates: args.dates.map(|dates| match dates {
            Dates::Mdy => DateOrder::Mdy,
            Dates::Dmy => DateOrder::Dmy,
            Dates::Ymd => DateOrder::Ymd,
        }),
        epoch: args.epoch.map(|epoch| match epoch {
            GivenEpoch::Posix => Epoch::Posix,
            GivenEpoch::Local1984 => Epoch::Local1984,
        }),
        doubt_ms: args.doubt_ms,
        map,
    })
}
