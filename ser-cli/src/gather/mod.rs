//! From the sources that the user names to the history of all recorders: recorders of a site that
//! are read now, files that were written before, and an archive.

#[cfg(feature = "archive")]
mod archive;
mod choice;
mod files;
mod live;
mod moment;
mod names;
mod readings;
#[cfg(feature = "archive")]
mod routine;
mod twins;

use std::path::PathBuf;

use ser_evidence::history::{Collector, History};
#[cfg(feature = "archive")]
use ser_evidence::incident::Incident;
use ser_evidence::incident::Which;
use ser_evidence::site::Site;
#[cfg(feature = "archive")]
use ser_evidence::time::{Moment, Utc};
#[cfg(feature = "archive")]
use ser_evidence::timeline::Timeline;
use ser_files::NotReached;
use ser_files::report::ArchiveHead;

#[cfg(feature = "archive")]
use crate::archive::Versions;
use crate::connection::{ConnectionArgs, ports};
use crate::error::{Failure, Result};
use crate::keeper::StateArgs;
#[cfg(feature = "archive")]
use archive::Excerpts;

pub(crate) use choice::ChoiceArgs;
pub(crate) use files::Damaged;
pub(crate) use moment::{GivenMoment, here, parse_moment};

/// Where entries come from.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Sources", group = clap::ArgGroup::new("kept").multiple(true))]
pub(crate) struct SourceArgs {
    /// Files with entries, written by `read` or `watch` with --format jsonl or csv, in any order.
    ///
    /// The recorder of a CSV file is the name of the file up to its last dot. Files speak for
    /// themselves, so --recorder needs --live here, and what this computer remembers of a
    /// recorder's clock is used where the recorder is read. Without this option all recorders of
    /// the site file that have a port are read; those that cannot be reached are named in the
    /// result.
    #[arg(long, value_name = "FILE", num_args = 1.., group = "kept")]
    input: Vec<PathBuf>,

    /// The archive that ser-cli collect has filled: a file, or `postgres://USER@HOST/DATABASE`.
    ///
    /// It takes the place of the recorders, which are read only with --live. Of millions of entries
    /// only those are read that the choice of time needs. Without --site, names are those of the
    /// site file that the archive says was in use at that time.
    #[cfg(feature = "archive")]
    #[arg(
        long,
        env = "SER_ARCHIVE",
        hide_env_values = true,
        value_name = "PLACE",
        value_parser = crate::archive::PlaceParser,
        group = "kept"
    )]
    archive: Option<ser_archive::Place>,

    /// Read the recorders of the site as well as what was kept.
    #[arg(long, requires = "kept")]
    live: bool,

    #[command(flatten)]
    state: StateArgs,
}

impl SourceArgs {
    /// The recorders of the site, and these files as well.
    pub(crate) const fn live_and(input: Vec<PathBuf>, state: StateArgs) -> SourceArgs {
        SourceArgs {
            input,
            #[cfg(feature = "archive")]
            archive: None,
            live: true,
            state,
        }
    }

    /// Whether nothing but recorders is read.
    fn reads_only_recorders(&self) -> bool {
        #[cfg(feature = "archive")]
        if self.archive.is_some() {
            return false;
        }
        self.input.is_empty()
    }

    /// Whether recorders are read.
    fn reads_recorders(&self) -> bool {
        self.live || self.reads_only_recorders()
    }

    /// Refuses to name a recorder where only files are read: each of them says whose it is.
    pub(crate) fn fit(&self, connection: &ConnectionArgs) -> Result<()> {
        let Some(name) = connection.recorder.as_ref().filter(|_| !self.reads_recorders()) else {
            return Ok(());
        };
        #[cfg(feature = "archive")]
        if self.archive.is_some() {
            return Err(Failure::usage(format!(
                "--recorder {name} says which recorder is read, and this is an archive"
            ))
            .hint(format!("ser-cli events --recorder {name} lists the entries of one recorder"))
            .hint("with --live the recorder is read as well"));
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
    /// Where the chains of the archive end, if there is one.
    pub(crate) archive_heads: Vec<ArchiveHead>,
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

/// A site of which only the zone of this computer is known.
pub(crate) fn nameless_site() -> Site {
    Site { time_zone: moment::here(), ..Site::unknown() }
}

/// What is wanted of the sources, with the site in whose zone times are; `None` is everything.
pub(crate) type Part<'a> = &'a dyn Fn(&Site) -> Result<Option<Which>>;

/// Everything is wanted.
pub(crate) const EVERYTHING: Part<'static> = &|_| Ok(None);

/// Reads all sources. Of an archive only what this part needs, which may be less than is there; all
/// that is told of the part is the same as if everything had been read.
pub(crate) fn gather(
    args: &SourceArgs,
    connection: &ConnectionArgs,
    part: Part<'_>,
) -> Result<Gathered> {
    let site = connection.chosen.as_deref().map(|chosen| chosen.site.clone());
    let reads_recorders = args.reads_recorders();
    if site.is_none() && reads_recorders {
        return Err(no_source(connection));
    }
    #[cfg(feature = "archive")]
    if let Some(place) = &args.archive {
        let given = connection.chosen.as_deref().map(|chosen| chosen.site.clone());
        let others = |site: &Site| Read::now(args, connection, site);
        return from_archive(place, given, part, &others);
    }
    #[cfg(not(feature = "archive"))]
    let _ = part;
    let site = site.unwrap_or_else(nameless_site);
    let (collector, read) = Read::now(args, connection, &site)?;
    read.finish(collector, site)
}

/// What was read besides archives, and where those end.
#[derive(Default)]
struct Read {
    damaged: Damaged,
    archive_heads: Vec<ArchiveHead>,
    missed_now: Vec<NotReached>,
}

impl Read {
    /// Reads files and recorders.
    fn now(
        args: &SourceArgs,
        connection: &ConnectionArgs,
        site: &Site,
    ) -> Result<(Collector, Read)> {
        let mut collector = Collector::new();
        let damaged = files::read(&args.input, site, &mut collector)?;
        let reads_recorders = args.reads_recorders();
        let missed_now = match reads_recorders {
            true => live::read(site, connection, &args.state, &mut collector)?,
            false => Vec::new(),
        };
        let reached = site.recorders.iter().filter(|recorder| {
            let is_meant = connection.recorder.as_ref().is_none_or(|name| *name == recorder.name);
            is_meant
                && recorder.port.is_some()
                && !missed_now.iter().any(|missed| missed.recorder == recorder.name)
        });
        if args.reads_only_recorders() && reached.count() == 0 {
            return Err(Failure::new("none of the recorders could be reached")
                .hint(
                    "is a ser-cli watch running, or another program on the line? End it meanwhile",
                )
                .hint("files that were written before can be given with --input FILE…"));
        }
        let archive_heads = Vec::new();
        Ok((collector, Read { damaged, archive_heads, missed_now }))
    }

    /// Puts everything together, and tells what is doubtful in it.
    fn finish(mut self, collector: Collector, mut site: Site) -> Result<Gathered> {
        let site_digest = site.digest.map(|digest| digest.to_string());
        names::take_over(&collector, &mut site);
        let mut history = collector.finish(&site);
        let not_reached = readings::not_reached(std::mem::take(&mut self.missed_now), &mut history);
        readings::tell(&history);
        twins::tell(&history);
        let Read { damaged, archive_heads, .. } = self;
        Ok(Gathered { site, history, site_digest, archive_heads, not_reached, damaged })
    }
}

/// Reads what stands beside an archive.
#[cfg(feature = "archive")]
type Others<'a> = &'a dyn Fn(&Site) -> Result<(Collector, Read)>;

/// What an archive has of a part, with the site that is given, or else with that of its time.
#[cfg(feature = "archive")]
pub(crate) fn archived(
    place: &ser_archive::Place,
    given: Option<Site>,
    part: Part<'_>,
) -> Result<Gathered> {
    let nothing = |_: &Site| Ok((Collector::new(), Read::default()));
    from_archive(place, given, part, &nothing)
}

/// Reads an archive, and what stands beside it. What is wanted of it depends on what it says of
/// clocks, so it is read until nothing more can belong to that.
#[cfg(feature = "archive")]
fn from_archive(
    place: &ser_archive::Place,
    given: Option<Site>,
    part: Part<'_>,
    others: Others<'_>,
) -> Result<Gathered> {
    let mut archive = crate::archive::read(place)?;
    let versions = match given {
        Some(_) => Versions::default(),
        None => Versions::of(&mut archive)?,
    };
    let mut site = given.or_else(|| versions.newest()).unwrap_or_else(nameless_site);
    let which = part(&site)?;
    let (others, mut read) = others(&site)?;
    read.archive_heads = crate::archive::heads(&mut archive)?;
    let mut excerpts = Excerpts::begin(archive)?;
    excerpts.want(&site, which)?;
    let (mut round, mut is_of_then) = (0, false);
    loop {
        let mut collector = others.clone();
        excerpts.collect(&mut collector)?;
        let Some(which) = which else { return read.finish(collector, site) };
        let mut named = site.clone();
        collector.name_inputs(&mut named);
        let history = collector.clone().finish(&named);
        let timeline = Timeline::new(&named, &history);
        round += 1;
        if !excerpts.is_enough(&timeline, which, round) {
            continue;
        }
        let of_then = began(&timeline, which).and_then(|at| versions.at(at));
        match of_then.filter(|of_then| !is_of_then && of_then.digest != site.digest) {
            // With other names another incident may be meant, and with that names change no more.
            Some(of_then) => (site, is_of_then) = (of_then, true),
            None => {
                drop(timeline);
                return read.finish(collector, site);
            }
        }
    }
}

/// When an entry of an archive was, as well as that is known without the entries around it.
#[cfg(feature = "archive")]
pub(crate) fn time_of(
    place: &ser_archive::Place,
    site: &Site,
    entry: &crate::archive::NamedEntry,
) -> Result<Moment<Utc>> {
    let mut excerpts = Excerpts::begin(crate::archive::read(place)?)?;
    excerpts.want(site, Some(Which::Last))?;
    excerpts.want_entry(&entry.recorder, entry.life, entry.sequence);
    let mut collector = Collector::new();
    excerpts.collect(&mut collector)?;
    let history = collector.finish(site);
    let timeline = Timeline::new(site, &history);
    let event = entry.find(&timeline).ok_or_else(|| {
        Failure::usage("the archive has no such entry")
            .hint("ser-cli incident list shows the names of incidents")
    })?;
    timeline.sort_key(event).map(Moment::from_us).ok_or_else(|| {
        Failure::new("nobody knows when this entry was: the clock was never set")
            .hint("ser-cli merge --archive lists everything, also without a time")
    })
}

/// When the incident began that is meant.
#[cfg(feature = "archive")]
pub(crate) fn began(timeline: &Timeline<'_>, which: Which) -> Option<Moment<Utc>> {
    let incident = Incident::pick(timeline, which)?;
    let first = incident.events.iter().find_map(|&event| timeline.sort_key(event));
    first.map(Moment::from_us)
}
