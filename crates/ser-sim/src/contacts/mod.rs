//! Contacts that move: where their moves come from, and the player that makes them on time.

mod breaker_trip;
pub(crate) mod player;
pub(crate) mod scenario;
pub(crate) mod scenario_error;
pub(crate) mod scenario_lines;
pub(crate) mod source;
pub(crate) mod step;
