//! `firmware`: builds the images and checks whether they may be flashed.

use crate::boards::{BOARDS, Board};
use crate::images::{self, build_and_check, toolchains};
use crate::setup::demand::Installing;
use crate::steps::Result;

const EXAMPLES: &str = "\
Examples:
  cargo xtask firmware
  cargo xtask firmware --board mps2-an385 --stack    also where the stack is used
  DEFMT_LOG=debug cargo xtask firmware               with more in the log

The checks read the image itself. It must stay within its budgets of flash and variables. Its \
stack must hold the worst case, and an overflow must end in a fault. Nothing may panic. Nothing \
that is needed while the flash is being erased may be in flash.";

/// Build the images for the boards and check whether they may be flashed.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Only for this board; by default for all.
    #[arg(long, value_parser = images::board)]
    board: Option<&'static Board>,

    /// Show the deepest paths through the program.
    #[arg(long)]
    stack: bool,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let boards: Vec<&Board> = match arguments.board {
        Some(board) => vec![board],
        None => BOARDS.iter().collect(),
    };
    let (found, missing) = toolchains(&boards, installing);
    let checked = build_and_check(&found, arguments.stack);
    // The other images have been built and checked by now.
    match (checked, missing.into_iter().next()) {
        (Ok(_), Some(missing)) => Err(missing),
        (checked, _) => checked.map(drop),
    }
}
