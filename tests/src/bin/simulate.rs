//! Whole-system simulation in virtual time: see `ser_tests::simulation`.

use std::fmt;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use ser_tests::simulation::{self, Options};

const EXAMPLES: &str = "\
Examples:
  cargo xtask simulate                          a hundred hours of seed 1
  cargo xtask simulate --seed 7 --hours 5000    one long run
  cargo xtask simulate --seeds 50               seeds 1 to 50, up to the first that fails
  cargo xtask simulate --bus-one-in 1           always on a bus
  cargo xtask simulate --load --hours 1         a change of all inputs in every millisecond

A bus is lived through scan by scan, and everything else from one event to the next: the hours with a bus are told apart.";

/// Run the whole system in virtual time, with random operations and faults, and account for every event.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask simulate", bin_name = "cargo xtask simulate", version, after_help = EXAMPLES)]
struct Arguments {
    /// Everything follows from this number.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Virtual time per seed, in hours.
    #[arg(long, default_value_t = 100.0)]
    hours: f64,

    /// So many seeds, one after the other.
    #[arg(long, default_value_t = 1)]
    seeds: u64,

    /// One life in so many, from power-up to power cut, is on a Genius bus.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..))]
    bus_one_in: u64,

    /// All inputs toggle in every millisecond, and everybody reads, prints and reports as fast as it goes.
    #[arg(long)]
    load: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut total = Pace::default();
    for seed in arguments.seed..arguments.seed.saturating_add(arguments.seeds) {
        match run(seed, &arguments) {
            Some(pace) => total = total.and(pace),
            None => return ExitCode::FAILURE,
        }
    }
    if arguments.seeds > 1 {
        println!("{} seeds, nothing unaccounted for: {total}", arguments.seeds);
    }
    ExitCode::SUCCESS
}

/// Virtual time, and how long it took.
#[derive(Clone, Copy, Default)]
struct Pace {
    virtual_ms: u64,
    real: Duration,
}

impl Pace {
    fn and(self, other: Pace) -> Pace {
        Pace { virtual_ms: self.virtual_ms + other.virtual_ms, real: self.real + other.real }
    }
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        #[expect(clippy::cast_precision_loss, reason = "for people")]
        let hours = self.virtual_ms as f64 / 3_600_000.0;
        let minutes = self.real.as_secs_f64() / 60.0;
        write!(f, "{hours:.2} virtual hours in {minutes:.2} min, {:.0} per minute", hours / minutes)
    }
}

/// Runs a seed and says what became of it; nothing when it failed.
fn run(seed: u64, arguments: &Arguments) -> Option<Pace> {
    let began = Instant::now();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "too large or small is as good as the end of the range"
    )]
    let duration_ms = (arguments.hours * 3_600_000.0).round() as u64;
    let simulate = if arguments.load { simulation::run_flat_out } else { simulation::run };
    match simulate(Options { seed, duration_ms, bus_one_in: arguments.bus_one_in }) {
        Ok(report) => {
            let pace = Pace { virtual_ms: report.hours.total_ms, real: began.elapsed() };
            println!("{report}\n  {pace}\n");
            Some(pace)
        }
        Err(failure) => {
            eprintln!("{failure}");
            None
        }
    }
}
