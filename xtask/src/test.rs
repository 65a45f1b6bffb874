//! `test`: runs all checks, with the tests last.

use std::process::Command;

use image_check::Checked;

use crate::boards::{BOARDS, MPS2_AN385};
use crate::setup::demand::{self, Demand, Installing, Kind};
use crate::setup::{self, emulator, programs};
use crate::steps::{self, Failure, Result, heading, note};
use crate::{evidence_mistakes, images, lint, plugin};

const EXAMPLES: &str = "\
Examples:
  cargo xtask test              installs cross toolchain and emulator if missing
  cargo xtask test --all        also installs external programs for single tests
  cargo xtask test --offline    installs nothing
  cargo xtask test --strict     as in CI: nothing is left out
  cargo test                    only the fast tests that need no other program

Missing tools that will be installed are listed first. What cannot be built or run here is left \
out, with a note. With --strict, or if the variable CI is \"true\", that is a failure.";

/// The variable in which the tests in the emulator find their image's stack bound, in bytes.
const STACK_VARIABLE: &str = "SER_STACK_BOUND_MPS2_AN385";

/// How the names of tests over the image of a board begin.
const IMAGE_TEST: &str = "image_of_";

/// The variable in which the tests that count instructions find the emulator's plugin.
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
    let (found, missing) = images::toolchains(&BOARDS.each_ref(), Installing::Forbidden);
    lint::firmware(&found, demand.is_strict())?;
    let checked = images::build_and_check(&found, false)?;
    if let Some(missing) = missing.into_iter().next().filter(|_| demand.is_strict()) {
        return Err(missing);
    }
    tests(demand, &checked)?;
    optional_parts()?;
    evidence_mistakes::all("")
}

/// Builds and runs the tests. Those in the emulator run only if it is installed and its image was
/// built.
fn tests(demand: Demand, images: &[Checked]) -> Result<()> {
    heading("Building the tests");
    steps::run(steps::cargo().args(["test", "--workspace", "--no-run"]))?;
    let emulated = images.iter().find(|image| image.board == MPS2_AN385.name());
    let Some(emulated) = emulated.filter(|_| emulator::there()) else {
        if demand.is_strict() {
            return Err(Failure::new("the tests in the emulator cannot be run here"));
        }
        heading("Tests, without those in the emulator");
        steps::run(steps::cargo().args(["test", "--workspace"]))?;
        return ignored_tests(images);
    };
    let plugin = match plugin::build() {
        Ok(plugin) => Some(plugin),
        // The tests that need the plugin are built for Linux only.
        Err(failure) if cfg!(not(target_os = "linux")) && !demand.is_strict() => {
            note(&format!("left out: {failure}"));
            None
        }
        Err(failure) => return Err(failure),
    };
    heading("Tests, with those in the emulator");
    let mut tests = all_tests();
    on_images(&mut tests, images);
    if let Some(bytes) = emulated.stack_bytes {
        tests.env(STACK_VARIABLE, bytes.to_string());
    }
    if let Some(plugin) = plugin {
        tests.env(PLUGIN_VARIABLE, plugin);
    }
    steps::run(&mut tests)
}

/// What a plain build leaves out.
fn optional_parts() -> Result<()> {
    heading("Tests of Parquet, which a plain build does not have");
    let mut written = steps::cargo();
    written.args(["test", "--package", "ser-files", "--features", "parquet"]);
    steps::run(written.args(["--test", "export", "parquet"]))?;
    let mut tests = steps::cargo();
    tests.args(["test", "--package", "ser-cli", "--features", "parquet"]);
    tests.args(["--test", "other_readers", "--", "--include-ignored", "parquet"]);
    steps::run(tests.args(programs::skipped()))?;
    heading("Tests of archives in PostgreSQL, which a plain build does not have");
    let mut archives = steps::cargo();
    archives.args(["test", "--package", "ser-archive", "--features", "postgres"]);
    archives.args(["--", "--include-ignored", "postgres"]);
    steps::run(archives.args(programs::skipped()))?;
    let mut forwarded = steps::cargo();
    forwarded.args(["test", "--package", "ser-cli", "--features", "postgres"]);
    forwarded.args(["--test", "collect_faults", "--", "--include-ignored", "postgres"]);
    steps::run(forwarded.args(programs::skipped()))
}

/// All tests except those whose programs are missing.
fn all_tests() -> Command {
    let mut tests = steps::cargo();
    tests.args(["test", "--workspace", "--", "--include-ignored"]).args(programs::skipped());
    tests
}

/// Tells tests the paths of the images, and leaves out tests over an image that was not built.
fn on_images(tests: &mut Command, images: &[Checked]) {
    for board in &BOARDS {
        match images.iter().find(|image| image.board == board.name()) {
            Some(image) => _ = tests.env(board.image_variable(), &image.file),
            None => _ = tests.args(["--skip", &format!("{IMAGE_TEST}{}", board.as_identifier())]),
        }
    }
}

/// The ignored tests that need no emulator.
fn ignored_tests(images: &[Checked]) -> Result<()> {
    heading("Tests with external programs");
    let mut others = steps::cargo();
    others
        .args(["test", "--workspace", "--", "--ignored", programs::MODULE])
        .args(programs::skipped());
    steps::run(&mut others)?;
    heading("Tests over the instructions of the images");
    let mut over_images = steps::cargo();
    over_images.args(["test", "--package", "image-check", "--lib", "--", "--ignored"]);
    on_images(&mut over_images, images);
    steps::run(&mut over_images)?;
    heading("Tests that take minutes");
    let long = ["test", "--package", "ser-tests", "--test", "simulation", "--", "--ignored"];
    steps::run(steps::cargo().args(long))?;
    let worlds = ["test", "--package", "ser-evidence", "--test", "rules", "--", "--ignored"];
    steps::run(steps::cargo().args(worlds))
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::fs;
    use std::path::PathBuf;

    use super::*;
    use crate::places;

    fn built(board: &'static str) -> Checked {
        let (outcomes, stack_paths) = (Vec::new(), String::new());
        Checked { board, file: PathBuf::from("elf"), outcomes, stack_bytes: None, stack_paths }
    }

    /// The variables and the arguments that a run with these images gets.
    fn told(images: &[Checked]) -> (Vec<String>, Vec<String>) {
        let mut command = Command::new("cargo");
        on_images(&mut command, images);
        let text = |text: &OsStr| text.to_string_lossy().into_owned();
        let variables = command.get_envs().map(|(name, _)| text(name)).collect();
        (variables, command.get_args().map(text).collect())
    }

    #[test]
    fn tests_are_told_where_each_image_is_and_those_without_are_left_out() {
        let both = BOARDS.each_ref().map(|board| built(board.name()));
        let variables = ["SER_IMAGE_MPS2_AN385", "SER_IMAGE_STM32F407"].map(str::to_owned);
        assert_eq!(told(&both), (variables.to_vec(), vec![]));
        let skipped = ["--skip", "image_of_stm32f407"].map(str::to_owned);
        assert_eq!(told(&both[..1]), (variables[..1].to_vec(), skipped.to_vec()));
    }

    #[test]
    fn there_is_a_test_over_the_image_of_each_board() {
        let source = places::root().join("crates/image-check/src/independent/images.rs");
        let source = fs::read_to_string(source).expect("the tests");
        for board in &BOARDS {
            assert!(source.contains(&format!("fn {IMAGE_TEST}{}()", board.as_identifier())));
            assert!(source.contains(&format!("\"{}\"", board.image_variable())));
        }
    }
}
