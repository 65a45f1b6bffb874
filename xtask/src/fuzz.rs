//! `fuzz`: lets libFuzzer look for input that breaks a property.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::places;
use crate::steps::{self, Failure, Result, heading};

const EXAMPLES: &str = "\
Examples:
  cargo xtask fuzz --list                      the names of the targets
  cargo xtask fuzz                             every target, a minute each
  cargo xtask fuzz --seconds 600 node          one target, ten minutes
  cargo test -p ser-tests --test fuzz_seeds    the known inputs: needs no fuzzer

Needs the nightly toolchain, cargo-fuzz and a C++ compiler. Inputs that reach new code \
are kept in tests/fuzz/corpus for the next run; see tests/fuzz/README.md.";

/// The longest search, in seconds: libFuzzer keeps it in an `int`.
const MAX_SECONDS: i64 = i32::MAX as i64;

/// The toolchain that can instrument programs.
const TOOLCHAIN: &str = "nightly";

/// Time limit for one input, in seconds; the slowest take a tenth of a second.
const INPUT_SECONDS: u32 = 20;

/// Memory limit of a target, in megabytes.
const MEMORY_MB: u32 = 1024;

/// Look for input that breaks the protocol, the recorder or its host, one target after the other.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Only these targets.
    #[arg(value_name = "TARGET")]
    targets: Vec<String>,

    /// How long to look, in seconds, for each target.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 60,
        allow_negative_numbers = true,
        value_parser = clap::value_parser!(u32).range(1..=MAX_SECONDS)
    )]
    seconds: u32,

    /// Name the targets and do nothing else.
    #[arg(long)]
    list: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let chosen = chosen(&arguments.targets, targets()?)?;
    if arguments.list {
        return steps::print(chosen.join("\n") + "\n");
    }
    check_tools()?;
    let mut broken = Vec::new();
    for target in &chosen {
        heading(&format!("{target}, {} s", arguments.seconds));
        plant_seeds(target)?;
        let known = artifacts(target);
        if let Err(failure) = steps::run(&mut fuzzer(target, arguments.seconds)) {
            let found: Vec<PathBuf> = artifacts(target).difference(&known).cloned().collect();
            if found.is_empty() {
                return Err(failure);
            }
            broken.push(describe(target, &found));
        }
    }
    if broken.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("some input breaks a property.\n{}", broken.concat())))
}

/// The targets that are named, or all of them.
fn chosen(named: &[String], all: Vec<String>) -> Result<Vec<String>> {
    match named.iter().find(|target| !all.contains(target)) {
        Some(unknown) => {
            Err(Failure::new(format!("there is no target {unknown}; there are {}", all.join(", "))))
        }
        None if named.is_empty() => Ok(all),
        None => Ok(named.to_vec()),
    }
}

fn folder() -> PathBuf {
    places::root().join("tests/fuzz")
}

/// The names of all targets.
fn targets() -> Result<Vec<String>> {
    let programs = folder().join("fuzz_targets");
    let files = fs::read_dir(&programs)
        .map_err(|error| Failure::new(format!("cannot read {}: {error}", programs.display())))?;
    let names = files.filter_map(|file| Some(file.ok()?.path().file_stem()?.to_str()?.to_owned()));
    let mut names: Vec<String> = names.collect();
    names.sort();
    Ok(names)
}

fn check_tools() -> Result<()> {
    let mut missing = String::new();
    if !steps::works(nightly("rustc").arg("--version")) {
        missing += &format!("\n  rustup toolchain install {TOOLCHAIN} --profile minimal");
    }
    if !steps::works(nightly("cargo").args(["fuzz", "--version"])) {
        missing += "\n  cargo install cargo-fuzz --locked";
    }
    if missing.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "the fuzzer cannot run yet. Install what is missing and try again:{missing}\n\
         It also needs a C++ compiler, and Linux or macOS. The known inputs are checked \
         without any of these:\n  \
         cargo test -p ser-tests --test fuzz_seeds"
    )))
}

/// A program of the instrumenting toolchain.
fn nightly(program: &str) -> Command {
    let mut command = steps::unrelated(program);
    command.env("RUSTUP_TOOLCHAIN", TOOLCHAIN).current_dir(places::root());
    command
}

/// Writes the seeds into the corpus, where the fuzzer begins.
fn plant_seeds(target: &str) -> Result<()> {
    let mut plant = helper("plant", target);
    steps::run(plant.arg(folder().join("corpus").join(target)))
}

/// The program that runs the targets without a fuzzer.
fn helper(verb: &str, target: &str) -> Command {
    let mut cargo = steps::cargo();
    cargo.args(["run", "--quiet", "-p", "ser-trial", "--example", "fuzzing", "--", verb, target]);
    cargo
}

fn fuzzer(target: &str, seconds: u32) -> Command {
    let mut cargo = nightly("cargo");
    // The only `unsafe` code is in the windows of boards. Sanitizers would find nothing else here,
    // and without them the fuzzer is twice as fast.
    cargo.args(["fuzz", "run", "--fuzz-dir", "tests/fuzz", "--sanitizer", "none", "--target-dir"]);
    cargo.arg(target_folder()).args([target, "--"]);
    cargo.arg(format!("-max_total_time={seconds}")).arg(format!("-timeout={INPUT_SECONDS}"));
    cargo.arg(format!("-rss_limit_mb={MEMORY_MB}")).arg("-print_final_stats=1");
    cargo
}

/// Where the targets are built. The folder is separate because the compiler is another one.
fn target_folder() -> PathBuf {
    match std::env::var_os("CARGO_TARGET_DIR") {
        Some(target) => places::root().join(target).join("fuzz"),
        None => folder().join("target"),
    }
}

/// The inputs that broke the target, now or earlier.
fn artifacts(target: &str) -> BTreeSet<PathBuf> {
    let files = fs::read_dir(folder().join("artifacts").join(target));
    files.into_iter().flatten().filter_map(|file| Some(file.ok()?.path())).collect()
}

/// How to continue with the inputs that were found.
fn describe(target: &str, found: &[PathBuf]) -> String {
    let mut text = format!("\n{target}:\n");
    for file in found {
        let file = file.strip_prefix(places::root()).unwrap_or(file).display();
        text += &format!(
            "  {file}\n    \
             to repeat it:    cargo run -p ser-trial --example fuzzing -- replay {target} \
             {file}\n    \
             to shorten it:   cargo +{TOOLCHAIN} fuzz tmin --fuzz-dir tests/fuzz --sanitizer \
             none {target} {file}\n"
        );
    }
    text + "  Once the fault is understood, a test in the crate and a seed with a telling name \
     keep it from coming back.\n"
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use clap::error::ErrorKind;

    use super::{Arguments, chosen};

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        _fuzz: Arguments,
    }

    #[test]
    fn a_target_that_there_is_not_is_refused_and_the_others_are_named() {
        let all = || vec!["client".to_owned(), "node".to_owned()];
        assert_eq!(chosen(&[], all()).unwrap(), all());
        assert_eq!(chosen(&all()[1..], all()).unwrap(), ["node"]);
        let refused =
            chosen(&["node".to_owned(), "bogus".to_owned()], all()).unwrap_err().to_string();
        assert!(refused.contains("bogus") && refused.contains("client, node"), "{refused}");
    }

    #[test]
    fn a_time_that_is_none_is_refused_as_a_number() {
        for wrong in ["0", "-5", "2147483648", "soon"] {
            let error = Line::try_parse_from(["fuzz", "--seconds", wrong]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::ValueValidation, "{error}");
        }
    }
}
