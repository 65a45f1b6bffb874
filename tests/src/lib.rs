//! Helpers of the end-to-end tests, which live in `tests/`.

pub mod vectors;
