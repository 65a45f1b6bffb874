//! Reading a log again and again, each time from where the last reading ended.
//!
//! [`follower`] reads what is new and begins anew where the log was changed under it; [`watcher`]
//! decides when to read, and whether the recorder is to report by itself.

pub(crate) mod follower;
mod read_new;
pub mod watcher;
