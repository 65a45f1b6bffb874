//! What the ARM image costs and what it bears, in instructions and in virtual time: the same
//! numbers in every run and on every machine.

#[cfg(target_os = "linux")]
pub mod bench;
#[cfg(target_os = "linux")]
pub mod costs;
#[cfg(target_os = "linux")]
pub mod genius;
#[cfg(target_os = "linux")]
pub mod lateness;
#[cfg(target_os = "linux")]
pub mod load;
#[cfg(target_os = "linux")]
pub mod lockstep;
#[cfg(target_os = "linux")]
mod masking;
#[cfg(target_os = "linux")]
pub mod program;
#[cfg(target_os = "linux")]
pub mod report;
#[cfg(target_os = "linux")]
pub mod tally;
