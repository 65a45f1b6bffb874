//! From the entries of several recorders to an answer: what moved first, by how much, what is
//! missing, and how sure that is.
//!
//! Everything here is a pure function of its input: no file, no port, no clock, no time zone of the
//! machine. The folders, each of which needs only those before it:
//!
//! - [`time`]: moments and bounds, each on a named scale, in whole microseconds;
//! - [`record`]: what is known, as it was read: entries, gaps, observations of clocks;
//! - [`site`]: what people know of the plant: names, roles, expectations;
//! - [`history`]: all records of a recorder put together, from any number of sources;
//! - [`clock`]: from observations to the offset of a recorder's clock, with its doubt;
//! - [`timeline`]: the entries of all recorders in one list, with what is proven of their order;
//! - [`incident`]: the answer for one incident.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub mod clock;
pub mod history;
pub mod incident;
pub mod record;
pub mod site;
pub mod time;
pub mod timeline;
