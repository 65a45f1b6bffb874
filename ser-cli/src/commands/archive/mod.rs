//! `archive`: whether an archive is whole and unchanged, copies of it, and how long it keeps.

mod backup;
mod check;
mod push;
mod retain;
mod verify;

use std::path::PathBuf;

use clap::ValueEnum;
use ser_archive::Place;

use crate::archive::{ArchiveArgs, PlaceParser};
use crate::error::Result;

const EXAMPLES: &str = "\
Examples:
  ser-cli archive check --archive plant.db     is anything missing?
  ser-cli archive verify --archive plant.db    has anybody changed it?
  ser-cli archive backup --archive plant.db -o copy.db
  ser-cli archive push --archive plant.db postgres://ser@db/plant
  ser-cli archive retain --archive plant.db --keep 5y";

const CHECK_EXAMPLES: &str = "\
Examples:
  ser-cli archive check --archive plant.db
  ser-cli archive check --archive plant.db --format json

The exit code is 3 if anything is missing, or if entries contradict each other. What the archive \
itself has let go when its time was over is no loss.";

const VERIFY_EXAMPLES: &str = "\
Examples:
  ser-cli archive verify --archive plant.db > heads.txt
  ser-cli archive verify --archive plant.db --head 5f1c…

The head of a chain is a SHA-256 over everything that one collector has added of one recorder. Write \
it down somewhere else: with --head it shows later whether rows at the end were taken away, or \
everything was made anew. Several can be given. The exit code is 1 if anything is wrong.";

const BACKUP_EXAMPLES: &str = "\
Examples:
  ser-cli archive backup --archive plant.db -o /backup/plant.db

Others may write meanwhile. The copy appears when it is whole, and takes the place of no other file.";

const PUSH_EXAMPLES: &str = "\
Examples:
  ser-cli archive push --archive plant.db postgres://ser@db/plant

What is there already changes nothing, so this may be interrupted and repeated. A collector does it \
all the time with --forward. The exit code is 3 if entries contradict others there.";

const RETAIN_EXAMPLES: &str = "\
Examples:
  ser-cli archive retain --archive plant.db --keep 5y
  ser-cli archive retain --archive plant.db --max-size 10GB --yes

What was added first goes first. A gap says what is gone; notes, gaps and what is known of clocks \
stay. Without --yes nothing goes.";

/// Check an archive, copy it, and let go of what is old.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Look whether anything is missing, told or not, and whether anything contradicts.
    #[command(after_help = CHECK_EXAMPLES)]
    Check(LookArgs),
    /// Reckon all chains of digests again, and show their heads.
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify {
        #[command(flatten)]
        look: LookArgs,
        /// A head that was written down earlier; it must still be in the archive.
        #[arg(long, value_name = "DIGEST", value_parser = verify::parse_head)]
        head: Vec<[u8; 32]>,
    },
    /// Copy the archive to a file.
    #[command(after_help = BACKUP_EXAMPLES)]
    Backup {
        #[command(flatten)]
        archive: ArchiveArgs,
        /// The new file.
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Give everything to another archive, for example a database.
    #[command(after_help = PUSH_EXAMPLES)]
    Push {
        #[command(flatten)]
        archive: ArchiveArgs,
        /// The other archive: a file, or `postgres://USER@HOST/DATABASE`.
        #[arg(value_name = "PLACE", value_parser = PlaceParser)]
        to: Place,
    },
    /// Let go of the oldest entries.
    #[command(after_help = RETAIN_EXAMPLES)]
    Retain(retain::RetainArgs),
}

/// At what is looked, and how the result is shown.
#[derive(Debug, clap::Args)]
struct LookArgs {
    #[command(flatten)]
    archive: ArchiveArgs,

    /// How the result is shown.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// How a result is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Text,
    /// One JSON object.
    Json,
}

/// The version of the objects.
const SCHEMA: u32 = 1;

pub(crate) fn run(args: &Args) -> Result<()> {
    match &args.what {
        What::Check(look) => check::run(look),
        What::Verify { look, head } => verify::run(look, head),
        What::Backup { archive, output } => backup::run(archive, output),
        What::Push { archive, to } => push::run(archive, to),
        What::Retain(args) => retain::run(args),
    }
}
