//! `test`: all there is to check, with the tests last.

use crate::setup::cross::CrossToolchain;
use crate::setup::{cross, emulator};
use crate::steps::{self, Result, heading, note};
use crate::{firmware, lint};

const EXAMPLES: &str = "\
Examples:
  cargo xtask test
  cargo test                only the tests that need neither emulator nor cross compiler

Where the ARM image cannot be built or run, the tests in the emulator are left out, and it is said what is missing.";

/// Where the tests in the emulator look for the image.
const IMAGE_VARIABLE: &str = "SER_IMAGE_MPS2_AN385";

/// Check format, clippy, documentation and image sizes; run all tests, including those in the emulator.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments) -> Result<()> {
    lint::host()?;
    let toolchain = cross::find();
    if let Ok(toolchain) = &toolchain {
        lint::firmware(toolchain)?;
        firmware::build_and_weigh(toolchain)?;
    }

    let mut tests = steps::cargo();
    tests.args(["test", "--workspace"]);
    match emulated(toolchain) {
        Ok(toolchain) => {
            // Found in its place: it was built above.
            tests.env(IMAGE_VARIABLE, firmware::build(&toolchain, &firmware::MPS2_AN385)?);
            tests.args(["--", "--include-ignored"]);
            heading("Tests, with those in the emulator");
        }
        Err(missing) => {
            heading("Tests, without those in the emulator");
            note(&format!("What is missing for those:{missing}\n"));
        }
    }
    steps::run(&mut tests)
}

/// The toolchain, if what it builds can be run, too.
fn emulated(toolchain: Result<CrossToolchain>) -> Result<CrossToolchain> {
    let toolchain = toolchain?;
    emulator::find()?;
    Ok(toolchain)
}
