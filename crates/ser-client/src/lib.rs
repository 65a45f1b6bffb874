//! A host's conversation with a sequential event recorder. It tells answers to commands from what
//! the recorder sends by itself. It reads the log by cursor, so that every event arrives once and
//! in order.
//!
//! Most programs want [`open`] and [`Unit`]: blocking calls over a serial port or TCP. Underneath,
//! [`Session`] (requests and their answers) and [`LogReader`] (which entries to read next) know
//! neither clock nor port. Any event loop can drive them, and tests can without waiting.
//!
//! On a Genius bus a recorder is reached through the window that a host shares with its GENI board.
//! [`GeniHost`] also knows who else is on the bus, and speaks to all of them.
//!
//! # The folders
//!
//! Each folder needs only those before it. `transport` knows this computer and its ports, `reading`
//! the log, `session` the conversation, and `genius` the bus. `unit` makes blocking calls of them,
//! and `following` reads again and again.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod following;
mod genius;
mod reading;
pub mod session;
mod transport;
mod unit;

pub use following::follower::{LogFollower, Step};
pub use following::watcher::{self, LogWatcher, ReportSwitch};
pub use geni_board::{BlockKind, Device as DeviceRecord, Status as BoardStatus};
#[cfg(unix)]
pub use genius::host::{BusDevice, GeniHost};
#[cfg(unix)]
pub use genius::recognition::{BusRecorders, Recognition};
pub use reading::cursor::Cursor;
pub use reading::delivery::{Delivery, Lost};
pub use reading::disturbed::Disturbed;
pub use reading::log_position::LogPosition;
pub use reading::range_reader::RangeReader;
pub use reading::read_request::ReadRequest;
pub use reading::reader::{self, LogReader};
pub use reading::summary::Summary;
pub use session::change::{Change, ChangeHook, Outcome, Stage};
pub use session::counters::Counters;
pub use session::diagnosis::Diagnosis;
pub use session::exchange::Exchange;
pub use session::options::Options;
pub use session::text_line::{LineAssembler, MAX_LINE_LEN, TextLine};
pub use session::unsolicited::Unsolicited;
pub use session::{Attempt, Busy, NoReply, Session, Timing};
pub use transport::Transport;
pub use transport::clock::{Clock, RealTime};
pub use transport::endpoint::{Endpoint, EndpointError, GeniWindow};
pub use transport::genius_error::GeniusError;
pub use transport::host_time::HostTime;
pub use transport::line_rate::LineRate;
pub use transport::open::open;
pub use transport::open_error::OpenError;
pub use transport::ports::{PortInfo, ports};
pub use transport::serial::SerialTransport;
pub use transport::tcp::TcpTransport;
pub use transport::transport_error::TransportError;
pub use unit::Unit;
pub use unit::extension::ClockLook;
pub use unit::request_error::RequestError;
