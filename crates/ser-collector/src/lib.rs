//! Reads the recorders of a site for years, and archives everything that they say.
//!
//! Each recorder has a thread. It reads what is new, files it together with the bookmark from which
//! it goes on, and only then counts it as read: a collector that is killed at any time reads the
//! same again, and the archive has it once. What fails is waited out with growing pauses. Meanwhile
//! the ring of the recorder is the buffer, and what it overwrites is told as a gap.
//!
//! # The files
//!
//! [`Collector`] starts and ends the threads, which `options` describe and of which `states` tell.
//! `check` looks whether recorders answer, and leaves it at that. `recorder` is what a thread does:
//! it visits the recorder, meets it (who is it, which log has it), follows its log, files
//! deliveries, and has duties besides. `ports` opens ways to recorders, `pause` waits, and
//! `trouble` is what may go wrong. `forward` gives an archive to another one, and `upkeep` lets go
//! of what is old.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod check;
mod collector;
mod forward;
mod options;
mod pause;
mod ports;
mod recorder;
mod states;
mod trouble;
mod upkeep;

pub use check::{Met, meet_all};
pub use collector::{Collector, Ended};
pub use forward::{Forwarded, forward};
pub use options::{DailyTime, Forward, Open, Options, Times};
pub use states::{Reached, State};
pub use trouble::Trouble;
