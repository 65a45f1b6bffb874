//! The whole system on trial, without hardware.
//!
//! [`simulation`] runs recorders, lines, buses and hosts through random operations and faults in
//! virtual time, and accounts for every event. [`fuzzing`] says what must hold whatever bytes
//! arrive. The other modules are what such trials and the end-to-end tests build on: a recorder
//! behind a pseudo-terminal, recorders on a bus, a host that reads or watches a log.

pub mod digits;
pub mod download;
pub mod fuzzing;
pub mod genius_world;
#[cfg(unix)]
pub mod recorder;
pub mod simulation;
pub mod slow_line;
pub mod watching;
