//! What an image has to keep to before it is flashed.
//!
//! Everything here is read off the image: nothing has to run, and nothing is taken on trust. What each board is held to
//! stands in [`boards`](crate::boards).

mod memory;
mod panics;
mod ram;
mod stack;

use std::collections::BTreeSet;

use crate::boards::Board;
use crate::image::Image;
use crate::image::calls::Calls;

pub(crate) use stack::{Share, bound, shares};

/// What came out of one check of one image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// What is checked.
    pub(crate) what: &'static str,
    /// In a few words; empty when the board is not asked.
    pub(crate) result: String,
    /// What is wrong, a line each; none when the image keeps to it.
    pub(crate) wrong: Vec<String>,
}

impl Outcome {
    fn new(what: &'static str, result: impl Into<String>, wrong: Vec<String>) -> Outcome {
        Outcome { what, result: result.into(), wrong }
    }
}

/// All checks of an image; the same number, in the same order, for each board.
pub(crate) fn all(board: &Board, image: &Image, calls: &Calls<'_>) -> Vec<Outcome> {
    vec![
        memory::flash(board, image),
        memory::variables(board, image),
        stack::depth(image, calls),
        stack::fault_handler(image, calls),
        stack::overflow(board, image),
        panics::none(board, image, calls),
        ram::while_erasing(board, image, calls),
    ]
}

/// The functions that end the program on purpose. Calls of theirs count for nothing.
pub(crate) fn forced(board: &Board, image: &Image) -> BTreeSet<u32> {
    board.forced.iter().filter_map(|(name, _)| image.function(name)).collect()
}
