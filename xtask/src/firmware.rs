//! `firmware`: builds the images and weighs them.

use std::path::PathBuf;

use crate::places;
use crate::setup::cross::{self, CrossToolchain};
use crate::sizes::Sizes;
use crate::steps::{self, Failure, Result, heading};

const EXAMPLES: &str = "\
Examples:
  cargo xtask firmware
  DEFMT_LOG=debug cargo xtask firmware    with more in the log";

const KIB: u64 = 1024;

/// A board and what its image may weigh.
pub(crate) struct Board {
    name: &'static str,
    package: &'static str,
    /// Goals, below what the memory map has: an affordable controller with room for more.
    flash_budget: u64,
    /// Variables, with an event log of full size.
    ram_budget: u64,
}

/// The emulated board.
pub(crate) const MPS2_AN385: Board =
    Board { name: "mps2-an385", package: "ser-mps2-an385", flash_budget: 48 * KIB, ram_budget: 48 * KIB };

impl Board {
    /// Where cargo puts the image.
    pub(crate) fn image(&self) -> PathBuf {
        places::firmware_target().join(cross::TARGET).join("release").join(self.package)
    }
}

const BOARDS: [Board; 1] = [MPS2_AN385];

/// Build the images for the boards and print their flash and RAM use against the budget.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments) -> Result<()> {
    build_and_weigh(&cross::find()?)
}

/// Builds one image; gives its file.
pub(crate) fn build(toolchain: &CrossToolchain, board: &Board) -> Result<PathBuf> {
    steps::run(toolchain.cargo("build").args(["--release", "--package", board.package]))?;
    Ok(board.image())
}

/// Builds all images and prints what they weigh. One that is over its budget is a failure.
pub(crate) fn build_and_weigh(toolchain: &CrossToolchain) -> Result<()> {
    heading("Firmware");
    let mut images = Vec::new();
    let mut over = Vec::new();
    for board in &BOARDS {
        let image = build(toolchain, board)?;
        images.push((board, Sizes::of_image(&image)?, image));
    }
    println!("\n{:<12}  {:<26}  {:<26}  stack", "board", "flash", "variables");
    for (board, sizes, _) in &images {
        let flash = against(sizes.flash, board.flash_budget);
        let ram = against(sizes.variables, board.ram_budget);
        println!("{:<12}  {flash:<26}  {ram:<26}  {}", board.name, kib(sizes.stack));
        if sizes.flash > board.flash_budget || sizes.variables > board.ram_budget {
            over.push(board.name);
        }
    }
    for (_, _, image) in &images {
        println!("{}", image.display());
    }
    if over.is_empty() { Ok(()) } else { Err(Failure::new(format!("over the budget: {}", over.join(", ")))) }
}

fn against(bytes: u64, budget: u64) -> String {
    let verdict = if bytes > budget { "OVER" } else { "of" };
    format!("{} {verdict} {} KiB ({} %)", kib(bytes), budget / KIB, bytes * 100 / budget)
}

/// With one decimal, rounded up: what is used is never shown as less.
fn kib(bytes: u64) -> String {
    let tenths = (bytes * 10).div_ceil(KIB);
    format!("{}.{} KiB", tenths / 10, tenths % 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_shown_against_the_budget() {
        assert_eq!(against(22_193, 48 * KIB), "21.7 KiB of 48 KiB (45 %)");
        assert_eq!(against(48 * KIB + 1, 48 * KIB), "48.1 KiB OVER 48 KiB (100 %)");
    }
}
