//! What the ARM image costs and what load it withstands, in instructions and in virtual time. The
//! numbers are the same in every run and on every machine.

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
