//! `timing`: the instructions of the ARM image, counted in the emulator.

use std::path::PathBuf;

use crate::setup::demand::Installing;
use crate::setup::emulator;
use crate::steps::{self, Failure, Result, heading};
use crate::{firmware, places};

const EXAMPLES: &str = "\
Examples:
  cargo xtask timing                      all of it, with ten seconds of load
  cargo xtask timing --load-seconds 60    with a minute of load

Seconds are of virtual time, which counts instructions: the numbers are the same in every run \
and on every machine. Exit code 1 when something is over budget, the capture interrupt late, \
or an event unaccounted for.";

/// What QEMU loads to tell of instructions.
const PLUGIN: &str = "ser-qemu-plugin";

/// From this version on QEMU has plugins name the second version of its interface.
const SECOND_INTERFACE: u32 = 9;

/// Count the instructions of the ARM image in the emulator, hold them against the budgets, and account for every
/// event of a load.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// How long all inputs change in every millisecond, in seconds.
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
    let image = firmware::build_emulated(installing)?;
    let plugin = build_plugin()?;
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
    timing.arg(arguments.load_seconds.to_string()).arg("--image").arg(image).arg("--plugin").arg(plugin);
    steps::become_program(&mut timing)
}

/// Builds the emulator's plugin for the emulator that there is; gives its file.
pub(crate) fn build_plugin() -> Result<PathBuf> {
    if cfg!(not(target_os = "linux")) {
        return Err(Failure::new(
            "instructions are counted by a plugin of the emulator, which is built for Linux only",
        ));
    }
    heading("Plugin for the emulator");
    let interface = if emulator::major_version() < Some(SECOND_INTERFACE) { "1" } else { "2" };
    let mut build = steps::cargo();
    build.env("SER_QEMU_PLUGIN_API", interface).args(["build", "--release", "--package", PLUGIN]);
    steps::run(&mut build)?;
    Ok(places::host_target().join("release/libser_qemu_plugin.so"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use clap::error::ErrorKind;

    use crate::{Arguments, Verb};

    fn understood(line: &[&str]) -> Result<u32, clap::Error> {
        match Arguments::try_parse_from([&["xtask", "timing"], line].concat())?.verb {
            Verb::Timing(arguments) => Ok(arguments.load_seconds),
            other => panic!("{other:?}"),
        }
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
