//! The archive: everything that was read of recorders, kept for years.
//!
//! An entry is what recorder, life and sequence say, so writing it twice changes nothing, and
//! another content at the same place is a conflict, which is kept and told. What is known besides
//! entries (gaps, lives, what clocks showed) is kept as it was read. What belongs together is
//! written in one transaction with the bookmark from which reading goes on, so the bookmark is
//! never ahead.
//!
//! # The files
//!
//! [`Archive`] is the way in: `archive` opens, `append` adds (with `joining`, where one log has
//! several names), `reading` gives back and `excerpt` a part, `outlet` notes who was given it,
//! `check` says what is missing, `verify` whether anybody has changed something, and `retention`
//! lets go of what is old; `numbers` are ranges of entries. [`Writer`] lets many threads use one
//! archive. Below these, `chain` reckons digests, `stored` makes columns of records, `schema` makes
//! tables, and `sql` is what a database must do; `sqlite` does it, and `postgres` where the feature
//! of this name is on.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod append;
mod archive;
mod batch;
mod chain;
mod check;
mod error;
mod excerpt;
mod joining;
mod numbers;
mod outlet;
mod place;
#[cfg(feature = "postgres")]
mod postgres;
mod reading;
mod retention;
mod schema;
mod sql;
mod sqlite;
mod stored;
mod verify;
mod writer;

pub use archive::{Access, Archive};
pub use batch::{Appended, Batch, Bookmark};
pub use check::{Check, Hole, RecorderCheck};
pub use error::{Error, Result};
pub use excerpt::{LeftOut, Wanted};
pub use place::{NoPlace, Place};
pub use reading::{Archived, Window};
pub use retention::{Expired, Keep};
pub use verify::{Broken, ChainHead};
pub use writer::{Ticket, Writer};
