//! Helpers of the end-to-end tests, which live in `tests/`.

#[cfg(unix)]
pub mod recorder;
pub mod vectors;
