//! `timing`: counts the instructions of the ARM image in the emulator.

use crate::setup::demand::Installing;
use crate::steps::{self, Result, heading};
use crate::{images, plugin};

const EXAMPLES: &str = "\
Examples:
  cargo xtask timing                      all of it, with ten seconds of load
  cargo xtask timing --load-seconds 60    with a minute of load

Seconds are of virtual time, which counts instructions: the numbers are the same in every run \
and on every machine. Exit code 1 if something is over budget, the capture interrupt is \
late, or an event is unaccounted for.";

/// Count the instructions of the ARM image in the emulator, compare them with the budgets, and
/// account for every event of a load.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Seconds of load, in which all inputs change in every millisecond.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10,
        allow_negative_numbers = true,
        value_parser = clap::value_parser!(u32).range(1..=86_400)
    )]
    load_seconds: u32,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let image = images::build_emulated(installing)?;
    let plugin = plugin::build()?;
    heading("Timing");
    let mut timing = steps::cargo();
    timing.args([
        "run",
        "--release",
        "--quiet",
        "-p",
        "image-bench",
        "--bin",
        "timing",
        "--",
        "--load-seconds",
    ]);
    timing
        .arg(arguments.load_seconds.to_string())
        .arg("--image")
        .arg(image)
        .arg("--plugin")
        .arg(plugin);
    steps::become_program(&mut timing)
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use clap::error::ErrorKind;

    use super::Arguments;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        timing: Arguments,
    }

    fn understood(line: &[&str]) -> Result<u32, clap::Error> {
        let line = Line::try_parse_from([&["timing"], line].concat())?;
        Ok(line.timing.load_seconds)
    }

    #[test]
    fn options_are_understood_before_anything_is_built() {
        assert_eq!(understood(&[]).unwrap(), 10);
        assert_eq!(understood(&["--load-seconds", "60"]).unwrap(), 60);
        assert_eq!(understood(&["--help"]).unwrap_err().kind(), ErrorKind::DisplayHelp);
        assert_eq!(understood(&["--bogus"]).unwrap_err().kind(), ErrorKind::UnknownArgument);
        for wrong in ["0", "-5", "86401", "soon"] {
            let error = understood(&["--load-seconds", wrong]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::ValueValidation, "{error}");
        }
    }
}
