//! Tests the driver with a scripted board that follows the manual's procedures and example
//! algorithms step by step.
//!
//! Offsets are written out here as the manual has them, so that a slip in the crate's map cannot
//! hide.

mod arrivals;
mod board;
mod commands;
mod failures;
mod hostile;
mod requests;
mod start_up;
mod tables;
mod watching;
mod world;
