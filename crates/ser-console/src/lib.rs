//! How programs write to a person's terminal, and notice that nobody reads any more.
//!
//! File names, an adapter's description and the words of a command line come from outside and may
//! hold anything, even what moves a terminal's cursor, changes its colours or reverses its text.
//! Such text passes through [`Harmless`] before it is shown. A program that takes arguments passes
//! clap's errors through [`explain`].

#[cfg(feature = "arguments")]
mod arguments;
mod harmless;

#[cfg(feature = "arguments")]
pub use arguments::{explain, print, unwritten};
pub use harmless::{Harmless, is_obeyed};
