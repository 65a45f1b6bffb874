//! From the sources that the user names to the history of all recorders: recorders of a site that
//! are read now, and files that were written before.

mod choice;
mod files;
mod live;
mod moment;
mod names;
mod readings;
mod twins;

use std::path::PathBuf;

use ser_evidence::history::{Collector, History};
use ser_evidence::site::Site;
use ser_files::NotReached;

use crate::connection::{ConnectionArgs, ports};
use crate::error::{Failure, Result};
use crate::keeper::StateArgs;

pub(crate) use choice::ChoiceArgs;
pub(crate) use files::Damaged;
pub(crate) use moment::{GivenMoment, here, parse_moment};

/// Where entries come from.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Sources")]
pub(crate) struct SourceArgs {
    /// Files with entries, written by `read` or `watch` with --format jsonl or csv, in any order.
    ///
    /// The recorder of a CSV file is the name of the file up to its last dot. Files speak for
    /// themselves, so --recorder needs --live here, and what this computer remembers of a recorder's
    /// clock is used where the recorder is read. Without this option all recorders of the site file
    /// that have a port are read; those that cannot be reached are named in the result.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    input: Vec<PathBuf>,

    /// Read the recorders of the site as well as the --input files.
    #[arg(long, requires = "input")]
    live: bool,

    #[command(flatten)]
    state: StateArgs,
}

impl SourceArgs {
    /// The recorders of the site, and these files as well.
    pub(crate) const fn live_and(input: Vec<PathBuf>, state: StateArgs) -> SourceArgs {
        SourceArgs { input, live: true, state }
    }

    /// Refuses to name a recorder where only files are read: each of them says whose it is.
    pub(crate) fn fit(&self, connection: &ConnectionArgs) -> Result<()> {
        let Some(name) = connection.recorder.as_ref().filter(|_| !self.input.is_empty()) else {
            return Ok(());
        };
        if self.live {
            return Ok(());
        }
        Err(Failure::usage(format!(
            "--recorder {name} says which recorder is read, and these are files"
        ))
        .hint("a file says whose it is; one of CSV is named after its recorder, as in U1.csv")
        .hint(format!("or say it with ser-cli import FILE --recorder {name} -o {name}.jsonl"))
        .hint("with --live the recorder is read as well"))
    }

    /// The files that are read, with the site file.
    pub(crate) fn files(&self, connection: &ConnectionArgs) -> Vec<PathBuf> {
        self.input.iter().chain(&connection.site).cloned().collect()
    }
}

/// Everything that the sources say.
#[derive(Debug)]
pub(crate) struct Gathered {
    pub(crate) site: Site,
    pub(crate) history: History,
    /// SHA-256 of the site file.
    pub(crate) site_digest: Option<String>,
    pub(crate) not_reached: Vec<NotReached>,
    /// Lines of files that could not be read.
    pub(crate) damaged: Damaged,
}

impl Gathered {
    /// Fails if something is known to be missing.
    pub(crate) fn require_complete(&self) -> Result<()> {
        let is_complete = self.not_reached.is_empty() && self.damaged.lines == 0;
        match is_complete {
            true => Ok(()),
            false => Err(Failure::incomplete("not everything could be read")),
        }
    }
}

/// Neither a site nor files; a port alone does not say which recorder it is.
fn no_source(connection: &ConnectionArgs) -> Failure {
    let failure = match ports(connection).first() {
        None => Failure::usage("from where? There is neither --site nor --input")
            .hint("with --site FILE all recorders of a site are read; see ser-cli site --help"),
        Some(port) => Failure::usage("recorders are read by their names in a site file")
            .hint(format!("ser-cli site new --port {port} > plant.toml writes one")),
    };
    failure.hint("--input FILE… takes what ser-cli read --format jsonl has written")
}

/// Reads all sources.
pub(crate) fn gather(args: &SourceArgs, connection: &ConnectionArgs) -> Result<Gathered> {
    let site = connection.chosen.as_deref().map(|chosen| chosen.site.clone());
    let reads_recorders = args.input.is_empty() || args.live;
    if site.is_none() && reads_recorders {
        return Err(no_source(connection));
    }
    let site_digest = site.as_ref().and_then(|site| Some(site.digest?.to_string()));
    let mut site = site.unwrap_or_else(|| Site { time_zone: moment::here(), ..Site::unknown() });
    let mut collector = Collector::new();
    let damaged = files::read(&args.input, &site, &mut collector)?;
    let missed_now = match reads_recorders {
        true => live::read(&site, connection, &args.state, &mut collector)?,
        false => Vec::new(),
    };
    let reached = site.recorders.iter().filter(|recorder| {
        let is_meant = connection.recorder.as_ref().is_none_or(|name| *name == recorder.name);
        is_meant
            && recorder.port.is_some()
            && !missed_now.iter().any(|missed| missed.recorder == recorder.name)
    });
    if args.input.is_empty() && reached.count() == 0 {
        return Err(Failure::new("none of the recorders could be reached")
            .hint("is a ser-cli watch running, or another program on the line? End it meanwhile")
            .hint("files that were written before can be given with --input FILE…"));
    }
    names::take_over(&collector, &mut site);
    let mut history = collector.finish(&site);
    let not_reached = readings::not_reached(missed_now, &mut history);
    readings::tell(&history);
    twins::tell(&history);
    Ok(Gathered { site, history, site_digest, not_reached, damaged })
}
