//! Checks an image against everything that its board requires.

use std::path::{Path, PathBuf};

use crate::calls::Calls;
use crate::checks::{self, Outcome};
use crate::image::{Image, ReadError};
use crate::limits::Limits;
use crate::stack_paths;

/// An image with the results of its checks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checked {
    /// The board's name.
    pub board: &'static str,
    /// Where the image is.
    pub file: PathBuf,
    /// The results; every board has the same checks in the same order.
    pub outcomes: Vec<Outcome>,
    /// The most stack that it can use, in bytes. `None` if there is no bound; then one of the
    /// checks has failed.
    pub stack_bytes: Option<u32>,
    /// The deepest paths through the program, as text.
    pub stack_paths: String,
}

/// Reads an image and checks it.
///
/// # Errors
/// If the file cannot be read or is not an ELF file.
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
