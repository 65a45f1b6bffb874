//! `test`: all there is to check, with the tests last.

use std::process::Command;

use image_check::Checked;

use crate::boards::{BOARDS, MPS2_AN385};
use crate::setup::demand::{self, Demand, Installing, Kind};
use crate::setup::{self, emulator, programs};
use crate::steps::{self, Failure, Result, heading, note};
use crate::{firmware, lint, timing};

const EXAMPLES: &str = "\
Examples:
  cargo xtask test              installs cross toolchain and emulator where they are missing
  cargo xtask test --all        installs the programs of others that single tests need, too
  cargo xtask test --offline    installs nothing
  cargo xtask test --strict     as in CI: nothing is left out
  cargo test                    only the tests that need no other program, nor minutes

What is missing, and will be installed, is said first. What cannot be built or run here is left out, and \
that is said, too; with --strict, and where CI is \"true\", it is a failure.";

/// Where the tests in the emulator look for the image.
const IMAGE_VARIABLE: &str = "SER_IMAGE_MPS2_AN385";

/// Where they look for the bound of its stack, in bytes.
const STACK_VARIABLE: &str = "SER_STACK_BOUND_MPS2_AN385";

/// Where those that count instructions look for the emulator's plugin.
const PLUGIN_VARIABLE: &str = "SER_QEMU_PLUGIN";

/// Check format, clippy, documentation and images; run all tests, including those in the emulator.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    demand: demand::Options,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let done = everything(Demand::here(arguments.demand, installing));
    steps::print_durations();
    done
}

fn everything(demand: Demand) -> Result<()> {
    heading("Tools");
    let targets = BOARDS.each_ref().map(|board| board.target);
    setup::make_ready(demand, &targets, &Kind::ALL)?;
    lint::host(demand.is_strict())?;
    let (found, missing) = firmware::toolchains(&BOARDS.each_ref(), Installing::Forbidden);
    lint::firmware(&found, demand.is_strict())?;
    let checked = firmware::build_and_check(&found, false)?;
    if let Some(missing) = missing.into_iter().next().filter(|_| demand.is_strict()) {
        return Err(missing);
    }
    tests(demand, checked.iter().find(|image| image.board == MPS2_AN385.name()))
}

/// Builds and runs the tests; those in the emulator where it is there and its image was built
/// above.
fn tests(demand: Demand, image: Option<&Checked>) -> Result<()> {
    heading("Building the tests");
    steps::run(steps::cargo().args(["test", "--workspace", "--no-run"]))?;
    let Some(image) = image.filter(|_| emulator::there()) else {
        if demand.is_strict() {
            return Err(Failure::new("the tests in the emulator cannot be run here"));
        }
        heading("Tests, without those in the emulator");
        steps::run(steps::cargo().args(["test", "--workspace"]))?;
        return ignored_tests();
    };
    let plugin = match timing::build_plugin() {
        Ok(plugin) => Some(plugin),
        // Those that need it are built for Linux only.
        Err(failure) if cfg!(not(target_os = "linux")) && !demand.is_strict() => {
            note(&format!("left out: {failure}"));
            None
        }
        Err(failure) => return Err(failure),
    };
    heading("Tests, with those in the emulator");
    let mut tests = all_tests();
    tests.env(IMAGE_VARIABLE, MPS2_AN385.image());
    if let Some(bytes) = image.stack_bytes {
        tests.env(STACK_VARIABLE, bytes.to_string());
    }
    if let Some(plugin) = plugin {
        tests.env(PLUGIN_VARIABLE, plugin);
    }
    steps::run(&mut tests)
}

/// All tests but those whose programs are missing.
fn all_tests() -> Command {
    let mut tests = steps::cargo();
    tests.args(["test", "--workspace", "--", "--include-ignored"]).args(programs::skipped());
    tests
}

/// The ignored tests that need no emulator.
fn ignored_tests() -> Result<()> {
    heading("Tests with programs of others");
    let mut others = steps::cargo();
    others.args(["test", "--workspace", "--", "--ignored", programs::MODULE]).args(programs::skipped());
    steps::run(&mut others)?;
    heading("Tests that take minutes");
    let long = ["test", "--package", "ser-tests", "--test", "simulation", "--", "--ignored"];
    steps::run(steps::cargo().args(long))
}
