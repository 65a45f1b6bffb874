//! What the ARM image costs and what it bears, in instructions and in virtual time: the same numbers in every run and
//! on every machine.

pub mod bench;
pub mod costs;
pub mod genius;
pub mod lateness;
pub mod load;
mod masking;
pub mod program;
pub mod report;
pub mod tally;
