//! `lint`: format, clippy and documentation.

use std::iter;

use crate::boards::{BOARDS, Board};
use crate::images::toolchains;
use crate::places;
use crate::setup;
use crate::setup::components::{self, Component};
use crate::setup::cross::CrossToolchain;
use crate::setup::demand::{Demand, Installing, Kind, Options};
use crate::steps::{self, Failure, Result, heading, note};

const EXAMPLES: &str = "\
Examples:
  cargo xtask lint              installs rustfmt, clippy and the cross toolchain if missing
  cargo xtask lint --offline    installs nothing
  cargo fmt --all               fixes the format; also run it in firmware/";

/// Check format, clippy and documentation of both workspaces; warnings are errors.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments, installing: Installing) -> Result<()> {
    heading("Tools");
    let demand = Demand::here(Options::default(), installing);
    let targets = BOARDS.each_ref().map(|board| board.target);
    setup::make_ready(demand, &targets, &Kind::OF_LINT)?;
    host(demand.is_strict())?;
    let (found, _) = toolchains(&BOARDS.each_ref(), Installing::Forbidden);
    firmware(&found, demand.is_strict())
}

/// The checks that need no cross toolchain. If `strict`, a missing component is a failure.
pub(crate) fn host(strict: bool) -> Result<()> {
    if strict {
        components::find(Installing::Forbidden)?;
    }
    if components::has(Component::Rustfmt) {
        heading("Format");
        let check = ["fmt", "--all", "--check"];
        steps::run(steps::cargo().args(check))?;
        steps::run(steps::cargo().current_dir(places::firmware()).args(check))?;
    }
    if components::has(Component::Clippy) {
        heading("Clippy");
        let deny = ["--", "-D", "warnings"];
        steps::run(steps::cargo().args(["clippy", "--workspace", "--all-targets"]).args(deny))?;
        for (package, feature) in
            [("xtask", "log"), ("ser-cli", "parquet,postgres"), ("ser-archive", "postgres")]
        {
            let with = ["clippy", "--package", package, "--features", feature, "--all-targets"];
            steps::run(steps::cargo().args(with).args(deny))?;
        }
        // What `xtask demo` builds.
        let plain = ["clippy", "--package", "ser-cli", "--no-default-features", "--all-targets"];
        steps::run(steps::cargo().args(plain).args(deny))?;
    }

    heading("Documentation");
    steps::run(steps::cargo().env("RUSTDOCFLAGS", "-D warnings").args([
        "doc",
        "--no-deps",
        "--workspace",
    ]))
}

/// Checks the firmware. If `strict`, a toolchain without clippy is a failure.
pub(crate) fn firmware(boards: &[(&Board, CrossToolchain)], strict: bool) -> Result<()> {
    for (board, toolchain) in boards {
        heading(&format!("Clippy on the firmware for {}", board.name()));
        for features in iter::once(&"").chain(board.features) {
            match toolchain.clippy() {
                Some(mut clippy) => {
                    let package = ["--release", "--package", board.package, "--features", features];
                    steps::run(clippy.args(package).args(["--", "-D", "warnings"]))?;
                }
                None if strict => return Err(Failure::new("this cross toolchain has no clippy")),
                None => note("left out: this cross toolchain has no clippy"),
            }
        }
    }
    Ok(())
}
