//! What programs say to people on a terminal, and how they notice that nobody listens any more.
//!
//! Names of files, what an adapter says of itself, the words of a command line: such text comes
//! from outside and may hold anything, also what moves a terminal's cursor, changes its colours or
//! turns its text around. It passes through [`Harmless`] before it is shown; a program that takes
//! arguments passes clap's errors through [`explain`].

#[cfg(feature = "arguments")]
mod arguments;
mod harmless;

#[cfg(feature = "arguments")]
pub use arguments::{explain, print, unwritten};
pub use harmless::Harmless;
