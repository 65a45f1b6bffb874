//! `incident`: what happened in the time of an archive, and what people say about it.

mod known;
mod list;
mod notes;

use clap::ValueEnum;

use crate::archive::{ArchiveArgs, IncidentName};
use crate::connection::ConnectionArgs;
use crate::error::Result;
use crate::gather::{GivenMoment, parse_moment};

const EXAMPLES: &str = "\
Examples:
  ser-cli incident list --archive plant.db
  ser-cli incident note U1-SER1/9f3c/120 relay test --archive plant.db
  ser-cli incident close U1-SER1/9f3c/120 no fault --archive plant.db

An incident has the name of its first event: recorder, the first digits of the life of its log, and \
sequence. Every other event of it names it as well. A note is kept in the archive beside what was \
read, with who wrote it, and cannot be changed; a later one opens a closed incident again.";

const LIST_EXAMPLES: &str = "\
Examples:
  ser-cli incident list --archive plant.db
  ser-cli incident list --archive plant.db --since 2026-01-01
  ser-cli incident list --archive plant.db --open --format json

Without a choice of time those of the last 30 days before the newest event are listed.";

const NOTE_EXAMPLES: &str = "\
Examples:
  ser-cli incident note U1-SER1/9f3c/120 relay test, no fault
  ser-cli incident note U1-SER1/9f3c/120 -- -86 was not reset";

const CLOSE_EXAMPLES: &str = "\
Examples:
  ser-cli incident close U1-SER1/9f3c/120
  ser-cli incident close U1-SER1/9f3c/120 relay test, no fault";

/// List the incidents of an archive, and keep remarks on them.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// List incidents: when, what moved first, whether anything is missing, what was said.
    #[command(after_help = LIST_EXAMPLES)]
    List(ListArgs),
    /// Add a remark on an incident. It opens the incident again if it was closed.
    #[command(after_help = NOTE_EXAMPLES)]
    Note {
        #[command(flatten)]
        on: OnArgs,
        /// The remark.
        #[arg(value_name = "TEXT", required = true)]
        text: Vec<String>,
    },
    /// Close an incident, with or without a remark.
    #[command(after_help = CLOSE_EXAMPLES)]
    Close {
        #[command(flatten)]
        on: OnArgs,
        /// The remark.
        #[arg(value_name = "TEXT")]
        text: Vec<String>,
    },
}

/// Which incidents are listed, and how.
#[derive(Debug, clap::Args)]
struct ListArgs {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// Those that began at this time or later.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    since: Option<GivenMoment>,

    /// Those that began until this time.
    #[arg(long, value_name = "TIME", value_parser = parse_moment)]
    until: Option<GivenMoment>,

    /// Only those that are not closed.
    #[arg(long)]
    open: bool,

    /// The format of the list.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// On which incident a remark is made.
#[derive(Debug, clap::Args)]
struct OnArgs {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// The incident, by its name in ser-cli incident list.
    #[arg(value_name = "INCIDENT")]
    incident: IncidentName,
}

/// How incidents are listed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Table,
    /// One JSON object.
    Json,
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    match &args.what {
        What::List(args) => list::run(args, connection),
        What::Note { on, text } => notes::add(on, &text.join(" "), false),
        What::Close { on, text } => notes::add(on, &text.join(" "), true),
    }
}
