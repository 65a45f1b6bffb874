//! An image against everything that its board asks of it.

use std::path::{Path, PathBuf};

use crate::calls::Calls;
use crate::checks::{self, Outcome};
use crate::image::{Image, ReadError};
use crate::limits::Limits;
use crate::stack_paths;

/// An image that has been checked, and what came out of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checked {
    /// The board's name.
    pub board: &'static str,
    /// Where the image is.
    pub file: PathBuf,
    /// Of each check; the same checks, in the same order, for each board.
    pub outcomes: Vec<Outcome>,
    /// How deep its stack can get at most, in bytes. None where there is no bound: one of the
    /// checks has failed then.
    pub stack_bytes: Option<u32>,
    /// For people: the deepest paths through the program.
    pub stack_paths: String,
}

/// Reads an image and checks it.
///
/// # Errors
/// The file cannot be read, or is no ELF file.
pub fn check(limits: &Limits, file: &Path) -> Result<Checked, ReadError> {
    let image = Image::read(file)?;
    let calls = Calls::of(&image, &checks::forced(limits, &image));
    Ok(Checked {
        board: limits.board,
        file: file.to_owned(),
        outcomes: checks::all(limits, &image, &calls),
        stack_bytes: checks::bound(&image, &calls).ok(),
        stack_paths: stack_paths::shown(limits, &image, &calls),
    })
}
