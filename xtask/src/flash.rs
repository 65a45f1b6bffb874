//! `flash`: puts an image onto a board.

use std::ffi::OsString;

use crate::boards::{BOARDS, Board};
use crate::images::{self, build_and_check};
use crate::setup::cross;
use crate::setup::demand::Installing;
use crate::steps::{self, Failure, Result, heading, unrelated, works};

const EXAMPLES: &str = "\
Examples:
  cargo xtask flash --board stm32f407
  cargo xtask flash --board stm32f407 --probe 0483:374b    if several probes are connected
  cargo xtask flash --board stm32f407 -- --speed 1000      with options of `probe-rs download`

`probe-rs list` shows the probes that are connected. The board restarts with the new image.";

const PROBE_RS: &str = "probe-rs";

/// Build the image for a board, check it, and flash it through a debug probe.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// The board to flash.
    #[arg(long, value_parser = images::board)]
    board: &'static Board,

    /// The probe, as `probe-rs list` shows it; only needed if several are connected.
    #[arg(long, value_name = "VID:PID[:SERIAL]")]
    probe: Option<String>,

    /// Options of `probe-rs download`.
    #[arg(last = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let board = arguments.board;
    let chip = board.chip.ok_or_else(|| emulated(board))?;
    if !works(unrelated(PROBE_RS).arg("--version")) {
        return Err(missing());
    }
    build_and_check(&[(board, cross::find_one(board.target, installing)?)], false)?;
    heading(&format!("Flashing {}", board.name()));
    let mut flash = unrelated(PROBE_RS);
    flash.args(["download", "--chip", chip, "--verify"]);
    if let Some(probe) = &arguments.probe {
        flash.args(["--probe", probe]);
    }
    steps::run(flash.args(&arguments.options).arg(board.image()))?;
    let mut reset = unrelated(PROBE_RS);
    reset.args(["reset", "--chip", chip]);
    if let Some(probe) = &arguments.probe {
        reset.args(["--probe", probe]);
    }
    steps::run(&mut reset)
}

fn emulated(board: &Board) -> Failure {
    let flashed: Vec<_> =
        BOARDS.iter().filter(|board| board.chip.is_some()).map(Board::name).collect();
    Failure::new(format!(
        "{} is emulated and has nothing to flash; run its image with\n  cargo xtask qemu --pty \
         /tmp/ser\n\
         Boards to flash: {}",
        board.name(),
        flashed.join(", ")
    ))
}

fn missing() -> Failure {
    Failure::new(
        "probe-rs, which drives the debug probe, is missing; get it with\n  \
         cargo install probe-rs-tools --locked\n\
         or download it ready to run from \
         https://probe.rs/docs/getting-started/installation",
    )
}
