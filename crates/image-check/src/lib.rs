//! Checks whether an image may be flashed.
//!
//! Everything is read from the image as the linker has left it; nothing has to run, and nothing is
//! assumed. [`check()`] compares an image with the [`Limits`] of its board, [`table()`] shows the
//! results, and [`verdict()`] refuses what may not be flashed.
//!
//! ```text
//! image        bytes, functions, and what of them is code
//! names        which functions belong to a panic
//! sizes        what it takes of the memories
//! thumb        one instruction
//! walk         one function along all its paths
//! calls        all functions together: who reaches whom, how deep the stack gets
//! checks       what an image has to keep to
//! stack_paths  where the stack goes
//! ```

mod calls;
mod check;
mod checks;
mod image;
#[cfg(test)]
mod independent;
mod limits;
mod names;
mod sizes;
mod stack_paths;
mod table;
mod thumb;
mod verdict;
mod walk;

pub use check::{Checked, check};
pub use checks::Outcome;
pub use image::ReadError;
pub use limits::{ALL, Limits, MPS2_AN385, STM32F407};
pub use table::table;
pub use verdict::{Refused, verdict};
