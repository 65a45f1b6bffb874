//! `collect`: recorders are read for years, and everything they say is archived.

mod check;
mod commands;
mod service;
mod shown;
mod telling;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use ser_archive::{Access, Archive, Place};
use ser_collector::{Collector, DailyTime, Ended, Forward, Open, Options, Times, Trouble};
use ser_evidence::site::Site;
use ser_observer::Author;

use crate::archive::{ArchiveArgs, PlaceParser, available, parse_keep, parse_size};
use crate::audit::AuditArgs;
use crate::connection::{self, ConnectionArgs, HEARTBEAT};
use crate::error::{Failure, Result, inform};
use crate::interrupt;
use crate::output::PROGRAM;
use crate::site_file::{self, Chosen};
use service::Service;

const EXAMPLES: &str = "\
Examples:
  ser-cli collect --site plant.toml            into plant.db, until Ctrl-C
  ser-cli collect --site plant.toml --check    is everything as it should be?
  ser-cli collect --site plant.toml --once     what is new, and that is all
  ser-cli collect --site plant.toml --archive postgres://ser@db/plant
  ser-cli collect --site plant.toml --forward postgres://ser@db/plant
  ser-cli collect --site plant.toml --set-clocks 03:30 --keep 5y

All recorders of the site that have a port are read, each by a thread of its own, and everything \
they say is archived: entries, what is missing, what their clocks showed, and for which time \
nothing was missed. Without --archive it goes to a file beside the site file, plant.db beside \
plant.toml. Nothing counts as read before it is on the disk, so the command may be killed at any \
time. A recorder that does not answer is asked again, after pauses of up to a minute.
With --forward everything is also given to a database of PostgreSQL. While that cannot be \
reached, it waits in the archive here.
What happens is told on standard error: outages, and once a day the heads of the chains, with \
which `archive verify` shows later that nothing was taken away. As a service of systemd the \
command says when it is ready and alive; docs/operations.md has a unit.
Recorders whose auto report is off are made to report while they are read, unless --poll is given.";

/// Read the recorders of a site for years, and archive everything.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// Read each recorder once, and end. Exit code 1 if any could not be read.
    #[arg(long)]
    once: bool,

    /// Look whether the site file, the archive and all recorders are as they should be, and read
    /// nothing.
    #[arg(long, conflicts_with = "once")]
    check: bool,

    /// Give everything to this database as well.
    #[arg(long, value_name = "ADDRESS", value_parser = PlaceParser)]
    forward: Option<Place>,

    /// How this collector is called in the archive; the name of this computer if not given.
    #[arg(long, value_name = "NAME", value_parser = collector_name)]
    name: Option<String>,

    /// Keep asking recorders instead of making them report.
    #[arg(long)]
    poll: bool,

    /// Set all clocks each day at this time, in the time zone of the site.
    #[arg(long, value_name = "HH:MM")]
    set_clocks: Option<DailyTime>,

    /// Let go of entries once they have been kept for so long: 90d, 26w, 5y.
    #[arg(long, value_name = "TIME", value_parser = parse_keep)]
    keep: Option<Duration>,

    /// Let go of the oldest entries when the archive takes more than this: 500MB, 10GB.
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    max_size: Option<u64>,

    /// This recorder was moved to another port, or is another unit now, on purpose. Otherwise what
    /// answers there and belongs elsewhere is not read.
    #[arg(long, value_name = "RECORDER")]
    moved: Vec<String>,

    /// End with exit code 3 if anything is known to be missing in what was read.
    #[arg(long)]
    fail_on_loss: bool,

    #[command(flatten)]
    audit: AuditArgs,

    /// How much faster everything is than it should be. For tests.
    #[arg(long, hide = true, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    hasten: u32,
}

/// How a collector may be called.
fn collector_name(text: &str) -> std::result::Result<String, &'static str> {
    let is_fine = (1..=100).contains(&text.chars().count())
        && text.trim() == text
        && !text.chars().any(char::is_control);
    if is_fine { Ok(text.to_owned()) } else { Err("a name is one line of up to 100 characters") }
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    let site = site(connection)?;
    let place = place(args, connection)?;
    fit(args, &site)?;
    available(&place)?;
    args.forward.as_ref().map_or(Ok(()), available)?;
    telling::begin();
    let stop = interrupt::catch()?;
    let options = options(args, connection, site)?;
    let open = opener(&place, args.hasten);
    if args.check {
        return check::run(&options, &open, &place, &stop);
    }
    commands::take_over(&mut open()?, &options.site, args.audit.directory())?;
    let names: Vec<&str> = with_port(&options.site).collect();
    inform(format_args!(
        "collecting {} into {place}{}",
        names.join(", "),
        if args.once { "" } else { " until Ctrl-C" }
    ));
    let (is_once, hasten) = (args.once, args.hasten);
    let collector = Collector::start(options, open, Arc::clone(&stop))?;
    let mut service = Service::begin();
    while !collector.is_over() && !stop.load(Ordering::Relaxed) {
        if collector.has_lost_a_thread() {
            // What is left is ended in good order, and a service is started anew.
            commands::keep(&collector.end().commands, args.audit.directory());
            return Err(Failure::new(
                "a thread of the collector has ended, which is a mistake in it",
            )
            .hint("start it again: nothing is lost that a recorder still has"));
        }
        service.is_alive(&collector);
        thread::sleep(HEARTBEAT / hasten.min(10));
    }
    service.ends();
    let ended = collector.end();
    commands::keep(&ended.commands, args.audit.directory());
    if is_once {
        shown::write(&ended)?;
    }
    outcome(args, ended)
}

/// How it went, as an exit code.
fn outcome(args: &Args, ended: Ended) -> Result<()> {
    if let Some(trouble) = ended.failed {
        return Err(match trouble {
            Trouble::Archive(error) => error.into(),
            other => Failure::new(other).hint("ser-cli collect --check looks at everything"),
        });
    }
    if let Some(error) = ended.not_forwarded {
        return Err(Failure::from(error).hint("what was read is archived here, and given on later"));
    }
    if args.once {
        let missed: Vec<&str> = ended.not_reached().map(|state| state.recorder.as_str()).collect();
        if !missed.is_empty() {
            let failure = Failure::new(format!("not read: {}", missed.join(", ")));
            return Err(failure.hint("ser-cli collect --check says what each recorder answers"));
        }
    }
    let gaps: u64 = ended.states.iter().map(|state| state.gaps).sum();
    match args.fail_on_loss && gaps > 0 {
        true => Err(Failure::incomplete(format_args!("losses: {gaps}"))),
        false => Ok(()),
    }
}

/// The site, which names the recorders.
fn site(connection: &ConnectionArgs) -> Result<Site> {
    let Some(chosen) = connection.chosen.as_deref() else {
        return Err(Failure::usage("which recorders? There is no --site")
            .hint("ser-cli site new --port PORT… -o plant.toml writes a site file"));
    };
    Ok(meant(chosen, connection))
}

/// The site, with the recorders that are meant alone.
fn meant(chosen: &Chosen, connection: &ConnectionArgs) -> Site {
    let mut site = chosen.site.clone();
    if let Some(name) = &connection.recorder {
        for recorder in &mut site.recorders {
            if recorder.name != *name {
                recorder.port = None;
            }
        }
    }
    site
}

fn with_port(site: &Site) -> impl Iterator<Item = &str> {
    let recorders = site.recorders.iter().filter(|recorder| recorder.port.is_some());
    recorders.map(|recorder| recorder.name.as_str())
}

fn fit(args: &Args, site: &Site) -> Result<()> {
    if with_port(site).next().is_none() {
        return Err(Failure::usage("no recorder of the site has a port, so none can be read")
            .hint("add port = \"…\" to a [[recorder]] of the site file"));
    }
    if let Some(moved) = args.moved.iter().find(|name| site.recorder(name).is_none()) {
        return Err(Failure::usage(format!("--moved: the site has no recorder {moved}"))
            .hint("ser-cli site show lists them"));
    }
    match &args.forward {
        Some(Place::File(file)) => {
            Err(Failure::usage(format!("--forward {}: this is no database", file.display()))
                .hint("write it as postgres://USER@HOST/DATABASE"))
        }
        _ => Ok(()),
    }
}

/// The archive; beside the site file if nobody says.
fn place(args: &Args, connection: &ConnectionArgs) -> Result<Place> {
    match (args.archive.named(), &connection.site) {
        (Some(place), _) => Ok(place.clone()),
        (None, Some(site)) => Ok(Place::File(site.with_extension("db"))),
        (None, None) => Err(Failure::usage("where is the archive? There is no --archive")
            .hint("name a file, as in --archive plant.db")),
    }
}

/// Opens the archive. Who hastens does not wait as long for others either.
fn opener(place: &Place, hasten: u32) -> Open {
    let place = place.clone();
    Arc::new(move || {
        let mut archive = Archive::open(&place, Access::Write { program: PROGRAM })?;
        if hasten > 1 {
            archive.set_patience(Duration::from_secs(10) / hasten)?;
        }
        Ok(archive)
    })
}

fn options(args: &Args, connection: &ConnectionArgs, site: Site) -> Result<Options> {
    let name = args.name.clone().map_or_else(computer, Ok)?;
    let forward = args
        .forward
        .as_ref()
        .map(|place| Forward { outlet: place.to_string(), open: opener(place, args.hasten) });
    Ok(Options {
        name,
        program: PROGRAM.to_owned(),
        site,
        site_text: site_text(connection)?,
        line: connection::options(connection),
        may_configure: !args.poll,
        set_clocks: args.set_clocks,
        moved: args.moved.iter().cloned().collect::<BTreeSet<_>>(),
        forward,
        keep_for: args.keep,
        keep_bytes: args.max_size,
        once: args.once,
        times: Times::default().faster(args.hasten),
    })
}

/// The site file as it is, so that an old incident is shown with the names of its time.
fn site_text(connection: &ConnectionArgs) -> Result<Option<String>> {
    let path = connection.site.as_deref();
    path.map(|path| site_file::text_of(path, "ser-cli site new writes a site file")).transpose()
}

/// The name of this computer.
fn computer() -> Result<String> {
    collector_name(Author::of_this_program(PROGRAM).host()).map_err(|why| {
        Failure::new(format!("the collector cannot be called as this computer is: {why}"))
            .hint("give it a name with --name")
    })
}
