//! Builds and checks the images.

use std::fmt::Display;
use std::path::PathBuf;

use image_check::{Checked, check, table, verdict};

use crate::boards::{BOARDS, Board, MPS2_AN385};
use crate::setup::cross::{self, CrossToolchain};
use crate::setup::demand::Installing;
use crate::setup::emulator;
use crate::steps::{self, Failure, Result, heading, note};

/// A board by its name, for arguments.
pub(crate) fn board(name: &str) -> std::result::Result<&'static Board, String> {
    let names: Vec<_> = BOARDS.iter().map(Board::name).collect();
    Board::named(name).ok_or_else(|| format!("the boards are {}", names.join(", ")))
}

/// The boards that can be built for, each with its toolchain, and the reasons why the others
/// cannot. The reasons have already been reported.
pub(crate) type Toolchains<'a> = (Vec<(&'a Board, CrossToolchain)>, Vec<Failure>);

/// Finds a toolchain for each board.
pub(crate) fn toolchains<'a>(boards: &[&'a Board], installing: Installing) -> Toolchains<'a> {
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    let targets: Vec<_> = boards.iter().map(|board| board.target).collect();
    for (&board, toolchain) in boards.iter().zip(cross::find(&targets, installing)) {
        match toolchain {
            Ok(toolchain) => found.push((board, toolchain)),
            Err(failure) => {
                note(&format!("left out: {}.{failure}", board.name()));
                missing.push(failure);
            }
        }
    }
    (found, missing)
}

/// Builds the image for the emulator, which must be installed, and returns its path.
pub(crate) fn build_emulated(installing: Installing) -> Result<PathBuf> {
    emulator::find(installing)?;
    let toolchain = cross::find_one(MPS2_AN385.target, installing)?;
    heading("Firmware");
    build(&toolchain, &MPS2_AN385)
}

/// Builds one image and returns its path.
fn build(toolchain: &CrossToolchain, board: &Board) -> Result<PathBuf> {
    steps::run(toolchain.cargo("build").args(["--release", "--package", board.package]))?;
    Ok(board.image())
}

/// Builds and checks images. An image that must not be flashed is a failure.
pub(crate) fn build_and_check(
    boards: &[(&Board, CrossToolchain)],
    stack: bool,
) -> Result<Vec<Checked>> {
    if boards.is_empty() {
        return Ok(Vec::new());
    }
    heading("Firmware");
    let mut images = Vec::new();
    for (board, toolchain) in boards {
        let image = build(toolchain, board)?;
        images.push(check(board.limits, &image).map_err(told)?);
    }
    let paths = images.iter().filter(|_| stack).map(|image| &*image.stack_paths);
    steps::print(table(&images) + &paths.collect::<String>())?;
    verdict(&images).map_err(told)?;
    Ok(images)
}

fn told(why: impl Display) -> Failure {
    Failure::new(why.to_string())
}
