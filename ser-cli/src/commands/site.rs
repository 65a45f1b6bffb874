//! `site`: the file that gives names to numbers.

mod check;
mod new;
mod show;
mod template;

use std::path::{Path, PathBuf};

use crate::connection::ConnectionArgs;
use crate::error::{Failure, Result};

const EXAMPLES: &str = "\
Examples:
  ser-cli site new -o north.toml          a file to begin with
  ser-cli site new -p COM3 -o north.toml  with what the recorder says
  ser-cli site check north.toml           what is wrong with it?
  ser-cli site show north.toml            what does it say?

The site file has what people know of the plant: names of recorders and inputs, what on and off \
mean, what is expected to happen. Every key is explained in the file that site new writes, and in \
docs/site-file.md.";

const NEW_EXAMPLES: &str = "\
Examples:
  ser-cli site new
  ser-cli site new -o north.toml
  ser-cli site new -p /dev/ttyUSB0 -p tcp://10.0.0.7:4000 -o north.toml";

const CHECK_EXAMPLES: &str = "\
Examples:
  ser-cli site check north.toml

All mistakes are told at once, on standard error, each with its line and with what would be right. \
The exit code is 1 if there are any; a warning is no mistake.";

const SHOW_EXAMPLES: &str = "\
Examples:
  ser-cli site show north.toml
  ser-cli site show north.toml --format json";

/// Write, check and show the file with the names of recorders and inputs.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Write a site file to begin with, in which every key is explained.
    ///
    /// Each recorder that is named with --port is asked for its model and the size of its log. A
    /// recorder that does not answer is in the file nevertheless.
    #[command(after_help = NEW_EXAMPLES)]
    New {
        /// The file to write, which must not exist yet; standard output if not given.
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Look for mistakes in a site file.
    #[command(after_help = CHECK_EXAMPLES)]
    Check {
        /// The site file; that of --site if not given.
        #[arg(value_name = "FILE")]
        file: Option<PathBuf>,
    },
    /// Show what a site file says, as tables.
    #[command(after_help = SHOW_EXAMPLES)]
    Show {
        /// The site file; that of --site if not given.
        #[arg(value_name = "FILE")]
        file: Option<PathBuf>,
        /// For people or for programs.
        #[arg(long, value_enum, default_value_t)]
        format: show::Format,
    },
}

pub(crate) fn run(args: &Args, connection: &ConnectionArgs) -> Result<()> {
    match &args.what {
        What::New { output } => new::run(output.as_deref(), connection),
        What::Check { file } => check::run(given(file.as_deref(), connection)?),
        What::Show { file, format } => show::run(given(file.as_deref(), connection)?, *format),
    }
}

fn given<'a>(file: Option<&'a Path>, connection: &'a ConnectionArgs) -> Result<&'a Path> {
    file.or(connection.site.as_deref()).ok_or_else(|| {
        Failure::usage("which site file? None is given, and SER_SITE is not set")
            .hint("name it, as in ser-cli site check north.toml")
            .hint("no site file yet? ser-cli site new -o north.toml")
    })
}
