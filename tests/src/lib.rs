//! Helpers of the end-to-end tests, which live in `tests/`.

pub mod digits;
pub mod download;
pub mod fuzzing;
pub mod genius_world;
pub mod pages;
#[cfg(unix)]
pub mod recorder;
pub mod simulation;
#[cfg(target_os = "linux")]
pub mod timing;
pub mod vectors;
pub mod watching;
