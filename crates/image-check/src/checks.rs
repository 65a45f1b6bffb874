//! What an image must comply with before it is flashed.
//!
//! Everything is read from the image; nothing has to run, and nothing is assumed. The requirements
//! of each board are in [`Limits`].

mod memory;
mod outcome;
mod panics;
mod ram;
mod stack;

use crate::calls::Calls;
use crate::image::Image;
use crate::limits::Limits;

pub use outcome::Outcome;
pub(crate) use panics::forced;
pub(crate) use stack::{bound, shares, together};

/// All checks of an image; every board has the same checks in the same order.
pub(crate) fn all(limits: &Limits, image: &Image, calls: &Calls<'_>) -> Vec<Outcome> {
    vec![
        memory::flash(limits, image),
        memory::variables(limits, image),
        stack::depth(image, calls),
        stack::fault_handler(image, calls),
        stack::overflow(limits, image),
        panics::none(limits, image, calls),
        ram::while_erasing(limits, image, calls),
    ]
}
