//! The records of evidence in files: what `ser-cli` writes, and what is made of it later.
//!
//! JSON lines ([`jsonl`]) hold every kind of record, and are written and read. CSV ([`csv`]) holds
//! entries and gaps, and is read. A [`Source`] tells the two apart by their content and yields
//! [`Told`](ser_evidence::record::Told) items, one after the other.
//!
//! Lists of other recorders and relays are read by [`import`], which makes JSON lines of them.
//!
//! Files come from outside. Whatever is in them, reading ends, and needs memory for one line. A
//! damaged line is an error with its number, and the lines after it can still be read.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub mod csv;
mod digits;
mod error;
pub mod export;
mod fields;
pub mod import;
pub mod jsonl;
mod lines;
pub mod merged;
mod missing;
mod names;
pub mod report;
mod source;
mod span;
mod stamp;

pub use error::{MAX_LINE_LEN, Problem, ReadError};
pub use missing::{NotReached, missing as missing_text};
pub use source::Source;
