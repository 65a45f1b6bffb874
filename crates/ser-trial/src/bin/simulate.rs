//! Whole-system simulation in virtual time: see `ser_trial::simulation`.

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use ser_trial::simulation::{self, Options, Paces};

const EXAMPLES: &str = "\
Examples:
  cargo xtask simulate                          a hundred hours of seed 1
  cargo xtask simulate --seed 7 --hours 5000    one long run
  cargo xtask simulate --seeds 50               seeds 1 to 50, up to the first that fails
  cargo xtask simulate --hours 1 --bus-one-in 1 always on a bus
  cargo xtask simulate --load --hours 1         a change of all inputs in every millisecond

A bus is simulated scan by scan, everything else from one event to the next, hundreds of times as
fast. A life on a bus is over in minutes, while another one may take days: of a hundred hours, a few
minutes are on a bus. Therefore both paces are reported.";

const MS_PER_HOUR: f64 = 3_600_000.0;

/// The longest run. More seeds are better than a longer run: they take more different ways, and a
/// failure is repeated sooner.
const MAX_HOURS: f64 = 100_000.0;

/// Run the whole system in virtual time, with random operations and faults, and account for every
/// event.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask simulate", bin_name = "cargo xtask simulate", version, after_help = EXAMPLES)]
struct Arguments {
    /// The number from which everything follows.
    #[arg(long, default_value_t = 1, value_parser = at_least::<0>, allow_negative_numbers = true)]
    seed: u64,

    /// Virtual time per seed, in hours: more than 0, at most 100000, which are eleven years.
    #[arg(
        long = "hours",
        value_name = "HOURS",
        default_value = "100",
        value_parser = duration_ms,
        allow_negative_numbers = true
    )]
    duration_ms: u64,

    /// How many seeds to run, one after the other. The largest seed is followed by 0.
    #[arg(long, default_value_t = 1, value_parser = at_least::<1>, allow_negative_numbers = true)]
    seeds: u64,

    /// How often a life, from power-up to power cut, is on a Genius bus: the first life, and one in
    /// this many of the others. With 0 there is no bus at all.
    #[arg(
        long,
        value_name = "LIVES",
        default_value_t = 8,
        value_parser = at_least::<0>,
        allow_negative_numbers = true
    )]
    bus_one_in: u64,

    /// All inputs toggle in every millisecond, and everybody reads, prints and reports as fast as
    /// possible.
    #[arg(long)]
    load: bool,
}

impl Arguments {
    /// The seeds to run, at least one.
    fn seeds(&self) -> impl Iterator<Item = u64> {
        (0..self.seeds).map(|count| self.seed.wrapping_add(count))
    }
}

/// A whole number that is not smaller than `LEAST`.
fn at_least<const LEAST: u64>(text: &str) -> Result<u64, String> {
    let number = text.parse().ok().filter(|number| *number >= LEAST);
    number.ok_or_else(|| format!("must be a whole number from {LEAST} to {}", u64::MAX))
}

/// Hours as milliseconds, at least one, because an empty run would find nothing wrong.
fn duration_ms(text: &str) -> Result<u64, String> {
    let hours = text.parse().ok().filter(|hours| *hours > 0.0 && *hours <= MAX_HOURS);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and bounded"
    )]
    let ms = hours.map(|hours: f64| (hours * MS_PER_HOUR).round() as u64);
    let ms = ms.filter(|ms| *ms > 0);
    ms.ok_or_else(|| format!("must be hours, from a millisecond (0.0000003) to {MAX_HOURS}"))
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ser_console::explain(error),
    };
    run_all(&arguments).map_or_else(|code| code, |()| ExitCode::SUCCESS)
}

/// Runs all seeds, up to the first that fails or until nobody reads the output any more. The error
/// is the exit code.
fn run_all(arguments: &Arguments) -> Result<(), ExitCode> {
    let mut total = Paces::default();
    for seed in arguments.seeds() {
        total += run(seed, arguments)?;
    }
    if arguments.seeds > 1 {
        print(format_args!("{} seeds, nothing unaccounted for\n  {total}\n", arguments.seeds))?;
    }
    Ok(())
}

fn print(text: impl Display) -> Result<(), ExitCode> {
    ser_console::print(text).map_err(|error| ser_console::unwritten(&error))
}

/// Runs a seed and says what became of it.
fn run(seed: u64, arguments: &Arguments) -> Result<Paces, ExitCode> {
    let Arguments { duration_ms, bus_one_in, .. } = *arguments;
    let simulate = if arguments.load { simulation::run_flat_out } else { simulation::run };
    match simulate(Options { seed, duration_ms, bus_one_in }) {
        Ok((report, paces)) => {
            print(format_args!("{report}\n  {paces}\n\n"))?;
            Ok(paces)
        }
        Err(failure) => {
            // When standard error is gone, nobody is left to be told.
            let _ = writeln!(io::stderr(), "{failure}");
            Err(ExitCode::FAILURE)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &[&str]) -> Result<Arguments, clap::Error> {
        Arguments::try_parse_from([&["simulate"], arguments].concat())
    }

    fn parsed(arguments: &[&str]) -> Arguments {
        parse(arguments).unwrap_or_else(|error| panic!("{arguments:?}: {error}"))
    }

    /// Checks that the arguments are refused for their value, in these words.
    fn assert_refused(arguments: &[&str], words: &str) {
        let error = parse(arguments).expect_err(words);
        assert_eq!(error.kind(), clap::error::ErrorKind::ValueValidation, "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }

    #[test]
    fn without_arguments_it_is_a_hundred_hours_of_seed_1() {
        let arguments = parsed(&[]);
        assert_eq!(arguments.seeds().collect::<Vec<_>>(), [1]);
        assert_eq!(arguments.duration_ms, 360_000_000);
    }

    #[test]
    fn hours_become_milliseconds() {
        for (hours, ms) in [("0.5", 1_800_000), ("0.0000003", 1), ("100000", 360_000_000_000)] {
            assert_eq!(parsed(&["--hours", hours]).duration_ms, ms);
        }
    }

    #[test]
    fn a_time_in_which_nothing_can_happen_or_that_never_ends_is_refused() {
        for hours in ["0", "0.0000001", "-1", "nan", "inf", "100000.1", "1e300", "ten", ""] {
            assert_refused(
                &["--hours", hours],
                "must be hours, from a millisecond (0.0000003) to 100000",
            );
        }
    }

    #[test]
    fn seeds_go_on_behind_the_largest() {
        let largest = u64::MAX.to_string();
        assert_eq!(parsed(&["--seed", &largest]).seeds().collect::<Vec<_>>(), [u64::MAX]);
        let seeds: Vec<u64> = parsed(&["--seed", &largest, "--seeds", "3"]).seeds().collect();
        assert_eq!(seeds, [u64::MAX, 0, 1]);
    }

    #[test]
    fn numbers_that_leave_nothing_to_run_are_refused() {
        for number in ["0", "-1", "1.5", "18446744073709551616"] {
            assert_refused(
                &["--seeds", number],
                "must be a whole number from 1 to 18446744073709551615",
            );
        }
        for option in ["--seed", "--bus-one-in"] {
            for number in ["-1", "x", "18446744073709551616"] {
                assert_refused(
                    &[option, number],
                    "must be a whole number from 0 to 18446744073709551615",
                );
            }
        }
    }
}
