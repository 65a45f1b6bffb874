//! `demo`: the main use from end to end, without hardware.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use ser_client::{Endpoint, LogFollower, Options, Unit};
use ser_proto::{Baud, Configuration, Model};
use ser_sim::{Backend, LineRate, Port, Scenario, SimOptions, Simulator, Step};

use super::sim;
use crate::error::{Failure, Result};
use crate::output::{Annotator, Before, EventWriter, Life, Palette, PointNames, Sequence};
use crate::time::local_time_in;

const EXAMPLES: &str = "\
Examples:
  ser-cli demo
  ser-cli demo --image firmware.elf  the ARM image, in QEMU";

/// Scenarios last seconds, but an emulator on a busy computer may run slower than its clock.
const PATIENCE: Duration = Duration::from_secs(60);

/// Play a breaker trip to a simulated recorder, and read the sequence of events from it.
///
/// Only the contacts are simulated. The recorder's own code samples them every millisecond, and the
/// client asks for the events in the frames of the RS-232 protocol, at 9600 baud over a
/// pseudo-terminal. The demo takes a few seconds.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// Run this ARM image (mps2-an385) in QEMU instead of the built-in recorder.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let mut story = Story { out: io::stdout(), palette: Palette::of_stdout() };
    let trip = Trip::new(&Scenario::breaker_trip());

    let simulator = Simulator::start(options(args)?)?;
    let port = simulator.port().to_string();
    let recorder = match args.image {
        Some(_) => "A recorder with 32 inputs (the ARM image, in QEMU)",
        None => "A simulated recorder with 32 inputs",
    };
    story.step(&format!("{recorder} is switched on."), "ser-cli sim --pty /tmp/ser")?;
    let mut unit = connect(&port)?;
    let mode = unit.mode()?;
    story.step(&format!("It answers: {mode}."), "ser-cli -p /tmp/ser status")?;
    play(&simulator, trip.before)?;
    let clock = unit.set_clock(|ahead| local_time_in(ahead).unwrap_or(EPOCH))?;
    story.step(&format!("Its clock is set: {clock}."), "ser-cli -p /tmp/ser clock set")?;
    unit.erase()?;
    story.step("Its log is erased. Now comes the incident.", "ser-cli -p /tmp/ser erase --yes")?;
    story.step(
        &format!(
            "A feeder fault: its relay trips the breaker, which recloses once,\n\
             onto the fault, and is locked out. {} contacts move in {:.1} s.",
            trip.changes, trip.seconds
        ),
        "ser-cli sim --pty /tmp/ser --contacts trip.csv",
    )?;
    play(&simulator, trip.incident)?;
    story.step("This is what it has recorded.", "ser-cli -p /tmp/ser read")?;
    let configuration = unit.configuration()?;
    let download = download(&mut unit, &configuration, trip.names, &mut story)?;
    // The emulator's line is as fast as the computer.
    let baud = args.image.is_none().then_some(configuration.baud);
    story.say(&format!("\n{}", download.summary(baud)))?;
    Ok(simulator.stop()?)
}

fn options(args: &Args) -> Result<SimOptions> {
    let port = if cfg!(unix) { Port::Pty { link: None } } else { Port::tcp("127.0.0.1:0") };
    let backend: Backend = sim::backend(args.image.as_deref(), None, LineRate::Real)?;
    Ok(SimOptions { backend, ..SimOptions::new(Model::Ser320, port) })
}

fn connect(port: &str) -> Result<Unit> {
    let lost = |error: &dyn std::fmt::Display| {
        Failure::new(format!("cannot reach the simulated recorder at {port}: {error}"))
            .hint("report this as a bug")
    };
    let endpoint: Endpoint = port.parse().map_err(|error| lost(&error))?;
    let transport = ser_client::open(&endpoint, Baud::default().bits_per_second())
        .map_err(|error| lost(&error))?;
    Ok(Unit::new(transport, Options { timeout: Duration::from_secs(5), ..Options::default() }))
}

fn play(simulator: &Simulator, scenario: Scenario) -> Result<()> {
    simulator.play(scenario)?;
    Ok(simulator.wait_played(PATIENCE)?)
}

/// The incident, and the state of the plant before it.
struct Trip {
    before: Scenario,
    incident: Scenario,
    names: PointNames,
    changes: usize,
    seconds: f64,
}

impl Trip {
    fn new(scenario: &Scenario) -> Trip {
        let (before, incident): (Vec<Step>, Vec<Step>) =
            scenario.steps().iter().partition(|step| step.at_ms == 0);
        let start_ms = incident.first().map_or(0, |step| step.at_ms);
        let changes = incident.len();
        let incident = Scenario::from_steps(
            incident.into_iter().map(|step| Step { at_ms: step.at_ms - start_ms, ..step }),
        );
        let names =
            scenario.names().into_iter().map(|(input, name)| (input, name.to_string())).collect();
        let seconds = Duration::from_millis(incident.duration_ms()).as_secs_f64();
        Trip { before: Scenario::from_steps(before), incident, names, changes, seconds }
    }
}

/// The result of reading the log.
struct Download {
    events: u32,
    lost: u32,
    bytes: u64,
    took: Duration,
}

fn download(
    unit: &mut Unit,
    configuration: &Configuration,
    names: PointNames,
    story: &mut Story<impl Write>,
) -> Result<Download> {
    let mut table = Sequence::new(&mut story.out, story.palette, names);
    let mut annotator = Annotator::new(Life::UNKNOWN, Before::default());
    let (bytes, began) = (unit.counters().bytes, Instant::now());
    let summary =
        LogFollower::new(None, configuration.size).read_new(unit, &mut |step| -> Result<()> {
            for delivery in step.deliveries {
                annotator.write(delivery, &mut table)?;
            }
            Ok(table.flush()?)
        })?;
    Ok(Download {
        events: summary.delivered,
        lost: summary.lost,
        bytes: unit.counters().bytes - bytes,
        took: began.elapsed(),
    })
}

impl Download {
    /// `baud` is the rate of the line, if the simulated line keeps to it.
    fn summary(&self, baud: Option<Baud>) -> String {
        let complete = match self.lost {
            0 => "complete".to_string(),
            lost => format!("{lost} lost"),
        };
        let took = match self.took.as_millis() {
            ms @ 0..1000 => format!("{ms} ms"),
            _ => format!("{:.1} s", self.took.as_secs_f64()),
        };
        let at = baud.map_or(String::new(), |baud| format!(" at {} baud", baud.bits_per_second()));
        format!(
            "{} events, {complete}. Downloaded in {took}: {} bytes{at}.",
            self.events, self.bytes
        )
    }
}

/// The narration.
struct Story<W> {
    out: W,
    palette: Palette,
}

impl<W: Write> Story<W> {
    /// What has happened, and the command for doing it oneself.
    fn step(&mut self, text: &str, command: &str) -> Result<()> {
        let Palette { command: style, faint, .. } = self.palette;
        writeln!(self.out, "{text}")?;
        writeln!(self.out, "  {faint}${faint:#} {style}{command}{style:#}\n")?;
        Ok(self.out.flush()?)
    }

    fn say(&mut self, text: &str) -> Result<()> {
        writeln!(self.out, "{text}")?;
        Ok(self.out.flush()?)
    }
}

/// Shown on a computer whose date no recorder can express.
const EPOCH: ser_proto::TimeStamp = ser_proto::TimeStamp {
    year: 70,
    month: 1,
    day: 1,
    hour: 0,
    minute: 0,
    second: 0,
    millisecond: 0,
};
