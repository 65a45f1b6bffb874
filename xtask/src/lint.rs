//! `lint`: format, clippy and documentation.

use crate::boards::{self, Board};
use crate::firmware::toolchains;
use crate::places;
use crate::setup::components;
use crate::setup::cross::CrossToolchain;
use crate::setup::demand::Installing;
use crate::steps::{self, Failure, Result, heading, note};

const EXAMPLES: &str = "\
Examples:
  cargo xtask lint
  cargo fmt --all           mends the format; in firmware/, too";

/// Check format, clippy and documentation of both workspaces; warnings are errors.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments, installing: Installing) -> Result<()> {
    components::find(installing)?;
    host()?;
    let (found, _) = toolchains(&boards::BOARDS.each_ref(), installing);
    firmware(&found, false)
}

/// All that needs no cross toolchain, but rustfmt and clippy.
pub(crate) fn host() -> Result<()> {
    heading("Format");
    steps::run(steps::cargo().args(["fmt", "--all", "--check"]))?;
    steps::run(steps::cargo().current_dir(places::firmware()).args(["fmt", "--all", "--check"]))?;

    heading("Clippy");
    let deny = ["--", "-D", "warnings"];
    steps::run(steps::cargo().args(["clippy", "--workspace", "--all-targets"]).args(deny))?;
    steps::run(steps::cargo().args(["clippy", "--package", "xtask", "--features", "log"]).args(deny))?;

    heading("Documentation");
    steps::run(steps::cargo().env("RUSTDOCFLAGS", "-D warnings").args(["doc", "--no-deps", "--workspace"]))
}

/// What is flashed. A toolchain without clippy is a failure where nothing may be left out.
pub(crate) fn firmware(boards: &[(&Board, CrossToolchain)], strict: bool) -> Result<()> {
    for (board, toolchain) in boards {
        heading(&format!("Clippy on the firmware for {}", board.name));
        match toolchain.clippy() {
            Some(mut clippy) => {
                let package = ["--release", "--package", board.package];
                steps::run(clippy.args(package).args(["--", "-D", "warnings"]))?;
            }
            None if strict => return Err(Failure::new("this cross toolchain has no clippy")),
            None => note("left out: this cross toolchain has no clippy"),
        }
    }
    Ok(())
}
