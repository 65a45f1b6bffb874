//! What a host learns of a recorder besides its entries, as evidence: what its clock showed and
//! when, which life its log is in, what its filters left out, and when an entry had not been there
//! yet.
//!
//! `ser-client` asks, `ser-evidence` reckons, and this crate makes the one's answers the other's
//! records. Whoever reads recorders, once or for years, does it with the same functions.
//!
//! # The files
//!
//! `host_reading` is this computer's clocks and `clock_setting` what a recorder's should show.
//! `clock_look` asks a clock, `setting` is what setting one says, and `log_look` where in the log
//! that was. `log_identity` is which log a recorder says that it has, `life_name` names its lives,
//! `arrival` is about entries that come, and `left_out` about changes that do not. `author` is who
//! changes recorders from here.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod arrival;
mod author;
pub mod clock_look;
mod clock_setting;
pub mod host_reading;
mod left_out;
mod life_name;
mod log_identity;
mod log_look;
pub mod setting;

pub use arrival::{HOLD_BACK_US, gap, seen_at};
pub use author::Author;
pub use clock_setting::ClockSetting;
pub use left_out::left_out;
pub use life_name::{life_of_recorder, new_life};
pub use log_identity::LogIdentity;
pub use log_look::{LogLook, nothing_after};
