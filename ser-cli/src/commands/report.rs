//! `report`: the answer after a trip, and signatures of it.

#[cfg(feature = "sign")]
mod key;
#[cfg(feature = "sign")]
mod keys;
#[cfg(feature = "sign")]
mod sign;
#[cfg(feature = "sign")]
mod verify;

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use ser_evidence::history::History;
use ser_evidence::incident::{Incident, Report, Which};
use ser_evidence::site::Site;
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::Timeline;
use ser_files::report::{self, Document, PageError, Styles};

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result, inform};
use crate::gather::{self, ChoiceArgs, Gathered, SourceArgs};
use crate::new_files::NewFiles;
use crate::outlet::{NotWritten, Outlet, file_named};
use crate::output::{PROGRAM, Palette};

const EXAMPLES: &str = "\
Examples:
  ser-cli report --site plant.toml            the last trip
  ser-cli report --site plant.toml -o t.html  as a page, with a picture
  ser-cli report --site plant.toml --last     the last incident, trip or not
  ser-cli report --site plant.toml --format json > report.json
  ser-cli report --input u1.jsonl u2.jsonl --around 2026-11-22T11:00:00

Without a choice the last incident is shown in which a point of role trip (or 86) went on; without \
such a point, the last one. Times without an offset are in the time zone of the site; a date alone \
is its midnight, and a time alone is today's.
What is not known is said: an order that the clocks cannot decide is a bracket, a first-out that \
is not certain is a set, and entries that are missing are a row of their own.";

/// Say what happened in an incident: what moved first, what operated, what is wrong or missing.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub(crate) struct Args {
    #[cfg(feature = "sign")]
    #[command(subcommand)]
    signature: Option<Signature>,

    #[command(flatten)]
    choice: ChoiceArgs,

    /// The format of the report; without it that of the file, or text.
    #[arg(long, value_enum)]
    format: Option<Format>,

    /// The file, instead of standard output (-): a page (.html), text (.txt) or JSON (.json). It
    /// appears when it is whole.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Overwrite an existing file.
    #[arg(long, requires = "output")]
    force: bool,

    /// Sign the file with this secret key: its signature is FILE.minisig, beside it.
    ///
    /// Both files appear, or none. ser-cli report key makes a key, and report verify checks the
    /// signature; minisign does, too. The password is asked for on the terminal, unless
    /// the variable `SER_SIGN_PASSWORD` is set.
    #[cfg(feature = "sign")]
    #[arg(long, value_name = "KEY")]
    sign: Option<PathBuf>,

    /// Show each change of a chattering contact.
    #[arg(long)]
    unfold: bool,

    /// End with exit code 3 if something is known to be missing in the incident.
    #[arg(long)]
    fail_on_loss: bool,

    #[command(flatten)]
    sources: SourceArgs,
}

/// What is done with signatures of reports.
#[cfg(feature = "sign")]
#[derive(Debug, clap::Subcommand)]
enum Signature {
    Verify(verify::Args),
    Key(key::Args),
}

/// The format of a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Text,
    /// A page with a picture: one file that needs no network, for screens and paper.
    Html,
    /// One JSON object with everything.
    Json,
}

impl Args {
    /// Where entries come from.
    pub(crate) const fn sources(&self) -> &SourceArgs {
        &self.sources
    }

    /// Whether the report goes to standard output.
    pub(crate) fn prints(&self) -> bool {
        !self.is_of_signatures() && file_named(self.output.as_deref()).is_none()
    }

    /// Whether this is about a signature, and no recorder is read.
    #[cfg(feature = "sign")]
    pub(crate) const fn is_of_signatures(&self) -> bool {
        self.signature.is_some()
    }

    /// Nothing is, in a build without signatures.
    #[cfg(not(feature = "sign"))]
    #[allow(clippy::unused_self, reason = "as in a build with them")]
    pub(crate) const fn is_of_signatures(&self) -> bool {
        false
    }
}

/// What signs a report.
#[cfg(feature = "sign")]
type Signer = sign::Signer;

/// Nothing does, in a build without signatures.
#[cfg(not(feature = "sign"))]
enum Signer {}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    #[cfg(feature = "sign")]
    match &args.signature {
        Some(Signature::Verify(args)) => return verify::run(args),
        Some(Signature::Key(args)) => return key::run(args),
        None => {}
    }
    let format = format(args)?;
    let path = file_named(args.output.as_deref());
    let mut files = NewFiles::new(args.force).sparing(args.sources.files(connection));
    let signer = signer(args, path, &mut files)?;
    let outlet = Outlet::open(path, files)?;
    let which = |site: &Site| Ok(args.choice.which(site)?.unwrap_or(Which::LastTrip));
    let gathered = gather::gather(&args.sources, connection, &|site| which(site).map(Some))?;
    let which = which(&gathered.site)?;
    let shown = Shown { format, unfold: args.unfold };
    let is_complete = write_signed(outlet, &gathered, which, shown, signer)?;
    if args.fail_on_loss {
        gathered.require_complete()?;
        if !is_complete {
            return Err(Failure::incomplete("entries are missing in the incident"));
        }
    }
    Ok(())
}

/// The key, if the report is to be signed, which needs a file.
#[cfg(feature = "sign")]
fn signer(args: &Args, path: Option<&Path>, files: &mut NewFiles) -> Result<Option<Signer>> {
    match (&args.sign, path) {
        (None, _) => Ok(None),
        (Some(key), Some(path)) => Signer::new(key, path, files).map(Some),
        (Some(_), None) => Err(Failure::usage("a report on standard output cannot be signed")
            .hint("name a file with -o: the signature is another file beside it")
            .hint("minisign -S signs a file of any program")),
    }
}

#[cfg(not(feature = "sign"))]
fn signer(_: &Args, _: Option<&Path>, _: &mut NewFiles) -> Result<Option<Signer>> {
    Ok(None)
}

/// How a report is shown; by default as text for people, with chatter folded.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shown {
    format: Format,
    unfold: bool,
}

impl Shown {
    /// As a page.
    pub(super) const PAGE: Shown = Shown { format: Format::Html, unfold: false };
}

/// Writes the report about an incident. Returns whether nothing is missing in it.
pub(super) fn write(
    outlet: Outlet,
    gathered: &Gathered,
    which: Which,
    shown: Shown,
) -> Result<bool> {
    write_signed(outlet, gathered, which, shown, None)
}

/// The same with a signature, if there is anything to sign with.
fn write_signed(
    outlet: Outlet,
    gathered: &Gathered,
    which: Which,
    shown: Shown,
    signer: Option<Signer>,
) -> Result<bool> {
    // Colours are for terminals.
    let styles = match outlet {
        Outlet::Stdout => styles(Palette::of_stdout()),
        Outlet::File(..) => Styles::default(),
    };
    let timeline = Timeline::new(&gathered.site, &gathered.history);
    let incident =
        Incident::pick(&timeline, which).ok_or_else(|| no_entry(which, &gathered.history))?;
    if let Which::Around(from, until) = which {
        tell_if_elsewhere(&timeline, &incident, (from, until));
    }
    let report = Report::new(&timeline, incident);
    let document = Document {
        timeline: &timeline,
        report: &report,
        program: PROGRAM,
        site_digest: gathered.site_digest.clone(),
        archive_heads: &gathered.archive_heads,
        not_reached: &gathered.not_reached,
        damaged_lines: gathered.damaged.lines,
        doubtful_hours: gathered.damaged.doubtful_hours,
        unfold: shown.unfold,
    };
    let write = |out: &mut (dyn Write + Send)| match shown.format {
        Format::Text => Ok(report::write_text(out, &document, styles)?),
        Format::Html => report::write_html(out, &document).map_err(|error| match error {
            PageError::Io(error) => NotWritten::Io(error),
            PageError::TooManyRows(_) => NotWritten::Failed(
                Failure::new(error)
                    .hint("choose less of it with --around, or with --since and --until")
                    .hint("--format text and json have no limit, nor have formats of export"),
            ),
        }),
        Format::Json => Ok(report::write_json(out, &document)?),
    };
    outlet.write_and(write, |file| signed(signer, file, &document))?;
    Ok(!document.is_incomplete())
}

/// Signs the report in a file, if it is to be.
#[cfg(feature = "sign")]
fn signed(signer: Option<Signer>, file: &mut File, document: &Document<'_>) -> Result<()> {
    let Some(signer) = signer else { return Ok(()) };
    signer.sign(
        file,
        &sign::About {
            site: &document.timeline.site().name,
            site_digest: document.site_digest.as_deref(),
            entries_digest: &document.report.digest,
        },
    )
}

#[cfg(not(feature = "sign"))]
fn signed(signer: Option<Signer>, _: &mut File, _: &Document<'_>) -> Result<()> {
    match signer {
        None => Ok(()),
        Some(signer) => match signer {},
    }
}

/// The format that the user wants, or that of the file's name.
fn format(args: &Args) -> Result<Format> {
    let Some(path) = file_named(args.output.as_deref()) else {
        return Ok(args.format.unwrap_or_default());
    };
    if let Some(format) = args.format {
        return Ok(format);
    }
    let extension = path.extension().and_then(|extension| extension.to_str());
    match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("html" | "htm") => Ok(Format::Html),
        Some("txt") => Ok(Format::Text),
        Some("json") => Ok(Format::Json),
        _ => Err(Failure::usage(format!("{} does not say its format", path.display()))
            .hint("name it .html, .txt or .json, or give --format")),
    }
}

/// The nearest incident may be days away from the time that was asked for.
fn tell_if_elsewhere(
    timeline: &Timeline<'_>,
    incident: &Incident,
    (from, until): (Moment<Utc>, Moment<Utc>),
) {
    let times = || incident.events.iter().filter_map(|&event| timeline.time(event));
    let (Some(first), Some(last)) = (times().min(), times().max()) else { return };
    let quiet_us = timeline.site().incident.quiet_us;
    let (away_us, where_) = match (first.since(until), from.since(last)) {
        (later, _) if later > quiet_us => (later, "later"),
        (_, earlier) if earlier > quiet_us => (earlier, "earlier"),
        _ => return,
    };
    let away = jiff::SignedDuration::from_secs(away_us / 1_000_000);
    inform(format_args!(
        "nothing happened at that time; the nearest incident was {away:#} {where_}"
    ));
}

fn no_entry(which: Which, history: &History) -> Failure {
    let mut lives = history.recorders.iter().flat_map(|recorder| &recorder.lives);
    let is_empty = !lives.any(|life| !life.entries.is_empty());
    let failure = match which {
        Which::Between(..) => Failure::new("there is no entry in this time"),
        _ if !is_empty => Failure::new("no entry has a time: the clock was never set"),
        _ => Failure::new("there is no entry in what was read"),
    };
    failure.hint("ser-cli merge with the same sources lists everything, also without a time")
}

pub(super) fn styles(palette: Palette) -> Styles {
    Styles {
        title: palette.title,
        faint: palette.faint,
        abnormal: palette.on,
        alarm: palette.alarm,
        first_out: palette.first_out,
    }
}
