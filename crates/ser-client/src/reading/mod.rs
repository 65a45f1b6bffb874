//! Which entries of a log to ask for, and what the replies mean, without clock and port.
//!
//! [`reader`] delivers every event once, from a cursor on. [`range_reader`] delivers entries by
//! their numbers. The other files hold the types that both readers use.

pub(crate) mod cursor;
pub(crate) mod delivery;
pub(crate) mod disturbed;
pub(crate) mod log_position;
pub(crate) mod range_reader;
pub(crate) mod read_request;
pub mod reader;
pub(crate) mod summary;
