//! `test`: all there is to check, with the tests last.

use crate::boards::{BOARDS, MPS2_AN385};
use crate::setup::emulator;
use crate::steps::{self, Result, heading, note};
use crate::{firmware, lint, timing};

const EXAMPLES: &str = "\
Examples:
  cargo xtask test
  cargo test          only the tests that need neither emulator nor cross compiler, nor minutes

What cannot be built or run here is left out, and it is said what is missing: the checks of an image, \
the tests in the emulator.";

/// Where the tests in the emulator look for the image.
const IMAGE_VARIABLE: &str = "SER_IMAGE_MPS2_AN385";

/// Where those that count instructions look for the emulator's plugin.
const PLUGIN_VARIABLE: &str = "SER_QEMU_PLUGIN";

/// Check format, clippy, documentation and images; run all tests, including those in the emulator.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments) -> Result<()> {
    lint::host()?;
    let (found, _) = firmware::toolchains(&BOARDS.each_ref());
    lint::firmware(&found)?;
    firmware::build_and_check(&found, false)?;

    let mut tests = steps::cargo();
    tests.args(["test", "--workspace"]);
    let mut with_ignored = false;
    let emulated = found.iter().any(|(board, _)| board.name == MPS2_AN385.name);
    match emulator::find() {
        Ok(()) if emulated => {
            // In its place: it was built above.
            tests.env(IMAGE_VARIABLE, MPS2_AN385.image());
            tests.args(["--", "--include-ignored"]);
            with_ignored = true;
            match timing::build_plugin() {
                Ok(plugin) => _ = tests.env(PLUGIN_VARIABLE, plugin),
                // Where there are no plugins, those tests say that they are left out.
                Err(_) if cfg!(not(target_os = "linux")) => {}
                Err(failure) => return Err(failure),
            }
            heading("Tests, with those in the emulator");
        }
        Ok(()) => heading("Tests, without those in the emulator: there is no image for it"),
        Err(missing) => {
            heading("Tests, without those in the emulator");
            note(&format!("What is missing for those:{missing}\n"));
        }
    }
    steps::run(&mut tests)?;
    if with_ignored { Ok(()) } else { long_tests() }
}

/// The tests that take minutes and no emulator.
fn long_tests() -> Result<()> {
    heading("Tests that take minutes");
    let long = ["test", "--package", "ser-tests", "--test", "simulation", "--", "--ignored"];
    steps::run(steps::cargo().args(long))
}
