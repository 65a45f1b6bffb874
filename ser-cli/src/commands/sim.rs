//! `sim`: a simulated unit.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use ser_proto::Model;
use ser_sim::{
    Backend, Contacts, EmulatorOptions, LineRate, NonVolatile, Notice, Port, SimError, SimOptions,
};

use crate::error::{Failure, Result, inform, warn};
use crate::interrupt;

const EXAMPLES: &str = "\
Examples:
  ser-cli sim --pty /tmp/ser                       its --port is /tmp/ser
  ser-cli sim --tcp 127.0.0.1:4000                 tcp://127.0.0.1:4000
  ser-cli sim --pty /tmp/ser --contacts trip.csv   with contacts that move
  ser-cli sim --pty /tmp/ser --image firmware.elf  the ARM image, in QEMU

Contacts are CSV: milliseconds from the start, input, 1 closed or 0 open.
  ms,input,state
  0,7,1
  250,7,0
On standard input (--contacts -) an empty line ends a scenario; more may follow.

When the unit answers, what to give to --port is written to standard output.";

/// Which recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ModelName {
    /// HE660SER160, 16 inputs.
    Ser160,
    /// HE660SER320, 32 inputs.
    Ser320,
}

impl From<ModelName> for Model {
    fn from(name: ModelName) -> Model {
        match name {
            ModelName::Ser160 => Model::Ser160,
            ModelName::Ser320 => Model::Ser320,
        }
    }
}

/// Simulate a unit on a pseudo-terminal or a TCP port, until interrupted.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Which recorder.
    #[arg(long, value_enum, default_value = "ser320")]
    model: ModelName,

    /// Make this symbolic link to the unit's pseudo-terminal; it appears when the unit answers and goes with it.
    #[arg(long, value_name = "LINK", conflicts_with = "tcp")]
    pty: Option<PathBuf>,

    /// Listen on this address instead; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT")]
    tcp: Option<String>,

    /// Move the unit's contacts as this CSV file says; `-` is standard input.
    #[arg(long, value_name = "FILE")]
    contacts: Option<PathBuf>,

    /// How long an input has to be steady until it counts.
    #[arg(long, value_name = "MS", default_value_t = 0)]
    debounce: u8,

    /// Send as slowly as the line's rate, as a real unit does; without it, answers come at once.
    #[arg(long, conflicts_with = "image")]
    paced: bool,

    /// Run this ARM image (mps2-an385) in QEMU instead of the built-in node.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,

    /// Write what the image logs to this file.
    #[arg(long, value_name = "FILE", requires = "image")]
    log: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let stop = interrupt::catch()?;
    Ok(ser_sim::run(options(args)?, &stop, announce)?)
}

fn options(args: &Args) -> Result<SimOptions> {
    let model = args.model.into();
    let port = match &args.tcp {
        Some(address) => Port::Tcp { address: address.clone() },
        None => Port::Pty { link: args.pty.clone() },
    };
    let contacts = match &args.contacts {
        Some(path) => Contacts::from_path(path, model)?,
        None => Contacts::None,
    };
    let rate = if args.paced { LineRate::Real } else { LineRate::Unlimited };
    Ok(SimOptions {
        contacts,
        debounce_ms: args.debounce,
        backend: backend(args.image.as_deref(), args.log.clone(), rate),
        notice: Some(Notice(Box::new(|text| warn(text)))),
        ..SimOptions::new(model, port)
    })
}

/// The emulated board if there is an image, the built-in node otherwise.
pub(crate) fn backend(image: Option<&Path>, log: Option<PathBuf>, line_rate: LineRate) -> Backend {
    match image {
        Some(image) => Backend::Emulator(EmulatorOptions { log, ..EmulatorOptions::new(image) }),
        None => Backend::Native { line_rate, non_volatile: NonVolatile::new() },
    }
}

fn announce(port: &str) {
    // A script that has read the port may close our output; the unit goes on.
    let mut out = io::stdout();
    let _ = writeln!(out, "{port}").and_then(|()| out.flush());
    inform("the simulated unit answers; Ctrl-C switches it off");
}

/// What went wrong in the simulator, with advice.
impl From<SimError> for Failure {
    fn from(error: SimError) -> Failure {
        Failure::new(&error).hint(match error {
            SimError::Scenario(_) => "see ser-cli sim --help for the format, and correct this line",
            SimError::LinkTaken(_) => "choose a name that does not exist, as in --pty /tmp/ser",
            SimError::EmulatorMissing { .. } => "or leave --image out: the built-in node needs no emulator",
            SimError::EmulatorEnded { .. } | SimError::NoAnswer { .. } => {
                "is this an image for mps2-an385? Build it with cargo xtask firmware"
            }
            SimError::Unsupported(_) => "use --tcp 127.0.0.1:4000, without --image",
            SimError::Io { .. } => "check names, rights, and that no other simulator runs there",
            SimError::Ended | SimError::StillPlaying => "try again; if it persists, report it as a bug",
        })
    }
}
