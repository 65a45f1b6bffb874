//! `sim`: a simulated recorder.

mod bus;

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::ValueEnum;
use ser_console::Harmless;
use ser_proto::Model;
use ser_proto::genius::BusAddress;
use ser_sim::{
    Backend, Contacts, EmulatorOptions, GeniusOptions, LineRate, MAX_NODES, NonVolatile, Notice,
    Port, SimError, SimOptions,
};

use crate::error::{Failure, Result, inform, warn};
use crate::interrupt;
use crate::values;

const EXAMPLES: &str = "\
Examples:
  ser-cli sim --pty /tmp/ser                       its --port is /tmp/ser
  ser-cli sim --tcp 127.0.0.1:4000                 tcp://127.0.0.1:4000
  ser-cli sim --pty /tmp/ser --contacts trip.csv   with contacts that move
  ser-cli sim --pty /tmp/ser --image firmware.elf  the ARM image, in QEMU
  ser-cli sim --genius /tmp/host --node 5 --node 9:ser160  a Genius bus
  ser-cli sim --genius /tmp/host --node 5 --bus-rate 38.4K --host-number 0
  ser-cli sim --genius /tmp/host --node 5 --bus-noise 2 --seed 7
  ser-cli sim --genius /tmp/host --node 5 --node 9 --image firmware.elf

Contacts are CSV: milliseconds from the start, input, 1 closed or 0 open.
  ms,input,state
  0,7,1
  250,7,0
On a Genius bus a fourth column, node, says whose input it is.
On standard input (--contacts -) times count from the arrival of the first
line; an empty line ends a scenario, and more may follow. A scenario that
arrives line by line begins 100 ms later, so that its first lines are not late.

Once the recorder answers, the values for --port are written to standard output,
one line for each way to reach a recorder.";

/// The model of the recorder.
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

/// A recorder on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct BusNode {
    number: u8,
    model: Option<ModelName>,
}

/// Simulate a recorder on a pseudo-terminal or a TCP port, or recorders on a Genius bus, until
/// interrupted.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The model of the recorder.
    #[arg(long, value_enum, default_value = "ser320")]
    model: ModelName,

    /// Make this symbolic link to the recorder's pseudo-terminal; it exists only while the recorder
    /// answers.
    #[arg(long, value_name = "LINK", conflicts_with = "tcp")]
    pty: Option<PathBuf>,

    /// Put recorders on a Genius bus; this file becomes the window of the host's GENI board, and is
    /// removed with the simulator.
    ///
    /// The first recorder also has its RS-232 port, where --pty or --tcp say.
    #[arg(long, value_name = "FILE", requires = "node", help_heading = bus::HEADING)]
    genius: Option<PathBuf>,

    /// Bus address of a recorder on the Genius bus, 0-31, and its model if it is not that of
    /// --model; may be repeated.
    #[arg(
        long,
        value_name = "N[:MODEL]",
        requires = "genius",
        value_parser = bus_node,
        help_heading = bus::HEADING
    )]
    node: Vec<BusNode>,

    #[command(flatten)]
    bus: bus::BusArgs,

    /// Listen on this address instead, for one client at a time; port 0 takes a free one.
    ///
    /// Anybody who reaches the address may do everything, erase included: on 127.0.0.1 this
    /// computer only, on 0.0.0.0 anybody.
    #[arg(long, value_name = "HOST:PORT", value_parser = tcp_address)]
    tcp: Option<String>,

    /// How long a silent client keeps its place when another one wants it; `never` lets it stay.
    #[arg(long, value_name = "TIME", default_value = "600s", value_parser = patience)]
    tcp_idle: Patience,

    /// Move the recorder's contacts as this CSV file says; `-` is standard input.
    #[arg(long, value_name = "FILE")]
    contacts: Option<PathBuf>,

    /// How long an input must be steady before a change counts.
    #[arg(long, value_name = "MS", default_value_t = 0)]
    debounce: u8,

    /// Send only as fast as the line's rate, as a real recorder does, and over TCP take no byte
    /// sooner, as behind a terminal server; without it, answers come at once.
    #[arg(long, conflicts_with = "image")]
    paced: bool,

    /// Run this ARM image (mps2-an385) in QEMU instead of the built-in recorder.
    ///
    /// On a Genius bus the image is the first --node; the others are built in.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,

    /// Write the image's log to this file, which must not exist yet; a pipe or a terminal may.
    #[arg(long, value_name = "FILE", requires = "image")]
    log: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let stop = interrupt::catch()?;
    let mut announced = Ok(());
    ser_sim::run(options(args, &stop)?, &stop, |ports| {
        announced = announce(ports);
        stop.fetch_or(announced.is_err(), Ordering::Relaxed);
    })?;
    announced
}

fn options(args: &Args, stop: &AtomicBool) -> Result<SimOptions> {
    let model = args.model.into();
    let port = match &args.tcp {
        Some(address) => Port::Tcp { address: address.clone(), gives_way_after: args.tcp_idle.0 },
        None if args.genius.is_some() && args.pty.is_none() => Port::Unconnected,
        None => Port::Pty { link: args.pty.clone() },
    };
    let genius = args.genius.as_deref().map(|window| genius(args, window, model)).transpose()?;
    let contacts = contacts(args, genius.as_ref(), stop)?;
    let rate = if args.paced { LineRate::Real } else { LineRate::Unlimited };
    Ok(SimOptions {
        contacts,
        debounce_ms: args.debounce,
        backend: backend(args.image.as_deref(), args.log.clone(), rate)?,
        genius,
        notice: Some(Notice(Box::new(|text| warn(text)))),
        ..SimOptions::new(model, port)
    })
}

/// The emulated board if there is an image, otherwise the built-in recorder.
pub(crate) fn backend(
    image: Option<&Path>,
    log: Option<PathBuf>,
    line_rate: LineRate,
) -> Result<Backend> {
    let Some(image) = image else {
        return Ok(Backend::Native { line_rate, non_volatile: NonVolatile::new() });
    };
    let options = EmulatorOptions { log, ..EmulatorOptions::new(image) };
    options.check_image().map_err(|error| {
        Failure::new(error)
            .hint("cargo xtask firmware builds the images and says where they are")
            .hint("or leave --image out: the built-in recorder needs none")
    })?;
    Ok(Backend::Emulator(options))
}

/// Reads the contacts. From a pipe, that waits for the writer.
fn contacts(args: &Args, genius: Option<&GeniusOptions>, stop: &AtomicBool) -> Result<Contacts> {
    let Some(path) = args.contacts.clone() else { return Ok(Contacts::None) };
    let (model, nodes) = (args.model.into(), genius.map(|genius| genius.nodes.clone()));
    let contacts = interrupt::unless_interrupted(stop, move || match nodes {
        Some(nodes) => Contacts::from_path_on_bus(&path, &nodes),
        None => Contacts::from_path(&path, model),
    })?;
    contacts_failure(contacts)
}

fn genius(args: &Args, window: &Path, model: Model) -> Result<GeniusOptions> {
    let nodes = &args.node;
    for (index, node) in nodes.iter().enumerate() {
        if nodes.iter().take(index).any(|other| other.number == node.number) {
            return Err(Failure::usage(format!("--node {} is given twice", node.number))
                .hint("every device on a bus has its own address"));
        }
    }
    if nodes.len() > MAX_NODES {
        return Err(Failure::usage("a bus has 32 addresses, and the host needs one")
            .hint("leave out one --node"));
    }
    let nodes = nodes.iter().map(|node| (node.number, node.model.map_or(model, Model::from)));
    args.bus.apply(GeniusOptions::new(window, nodes.collect()))
}

fn bus_node(text: &str) -> std::result::Result<BusNode, String> {
    let (number, model) = match text.split_once(':') {
        Some((number, model)) => (number, Some(ModelName::from_str(model, true)?)),
        None => (text, None),
    };
    let number = device(number)
        .ok_or_else(|| "not a bus address: 0 to 31, as in 5 or 5:ser160".to_string())?;
    Ok(BusNode { number, model })
}

fn device(text: &str) -> Option<u8> {
    values::bus_address(text).ok().map(BusAddress::number)
}

fn contacts_failure(contacts: std::result::Result<Contacts, SimError>) -> Result<Contacts> {
    contacts.map_err(|error| match &error {
        SimError::Io { .. } => Failure::new(&error)
            .hint("--contacts names a CSV file; ser-cli sim --help shows what is in it")
            .hint("or play contacts by hand: --contacts - reads standard input"),
        _ => error.into(),
    })
}

/// How long a client may be silent while another one waits; `None` means for ever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Patience(Option<Duration>);

fn patience(text: &str) -> std::result::Result<Patience, String> {
    let time = if text == "never" { Ok(None) } else { values::duration(text).map(Some) };
    time.map(Patience).map_err(|why| format!("{why}; or never"))
}

/// Checks an address to listen on, as far as possible without asking the system.
fn tcp_address(text: &str) -> std::result::Result<String, String> {
    match text.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
            Ok(text.to_string())
        }
        _ => Err("it has to be HOST:PORT, as in 127.0.0.1:4000".to_string()),
    }
}

/// Prints all the ways to reach the recorders, one per line.
fn announce(ports: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    // A script gets the names unchanged. A terminal would obey control characters, so they are
    // filtered there.
    let is_terminal = out.is_terminal();
    let shown = |port: &str| if is_terminal { Harmless(port).line() } else { port.to_owned() };
    let written = ports.lines().try_for_each(|port| writeln!(out, "{}", shown(port)));
    match written.and_then(|()| out.flush()) {
        // A script that has read the port may close our output; the recorder goes on.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        written => written?,
    }
    inform("the simulated recorder answers; Ctrl-C switches it off");
    Ok(())
}

/// The failure of the simulator, with advice.
impl From<SimError> for Failure {
    fn from(error: SimError) -> Failure {
        let failure = match &error {
            SimError::NoRecords(no_records) => {
                no_records.hints().fold(Failure::new(&error), Failure::hint)
            }
            _ => Failure::new(&error),
        };
        failure.hint(match error {
            SimError::Scenario(_) => "see ser-cli sim --help for the format, and correct this line",
            SimError::NoSuchHost(_) => "check the spelling, or give an IP address",
            SimError::LinkTaken(_) | SimError::LinkInUse(_) => {
                "choose a name that does not exist, as in --pty /tmp/ser"
            }
            SimError::WindowTaken(_) | SimError::WindowInUse(_) => {
                "choose a name that does not exist, as in --genius /tmp/host"
            }
            SimError::LogTaken(_) => "choose a name that does not exist, as in --log /tmp/ser.log",
            SimError::EmulatorMissing { .. } => {
                "or leave --image out: the built-in recorder needs no emulator"
            }
            SimError::EmulatorEnded { .. } | SimError::NoAnswer { .. } => {
                "is this an image for mps2-an385? Build it with cargo xtask firmware"
            }
            SimError::Unsupported(_) => "use --tcp 127.0.0.1:4000, without --image",
            SimError::Io { ref source, .. } => match source.kind() {
                io::ErrorKind::UnexpectedEof => {
                    "the file has been cut short: leave it alone while it is in use"
                }
                io::ErrorKind::AddrInUse => {
                    "another program listens there: port 0 takes a free \
                 one"
                }
                io::ErrorKind::AddrNotAvailable => {
                    "that is not this computer: use 127.0.0.1, or 0.0.0.0, where anybody may erase"
                }
                _ => "check names, rights, and that no other simulator runs there",
            },
            SimError::NoRecords(_) => {
                "one of these folders is needed, but not for --tcp without \
             --genius"
            }
            SimError::Ended | SimError::StillPlaying => {
                "try again; if it persists, report it as \
             a bug"
            }
        })
    }
}
