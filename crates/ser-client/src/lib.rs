//! A host's conversation with a sequential event recorder: commands and their answers, told apart from what the
//! recorder says by itself, and a log that is read by cursor, so that every event arrives once and in order.
//!
//! Most programs want [`open`] and [`Unit`]: blocking calls over a serial port or TCP. Underneath, [`Session`]
//! (requests and their answers) and [`LogReader`] (which entries to read next) know neither clock nor port; they can
//! be driven by any event loop, and by tests without waiting.
//!
//! On a Genius bus a unit is reached through the window that a host shares with its GENI board; [`GeniHost`] also knows
//! who else is on the bus, and speaks to all of them.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod clock;
mod counters;
mod cursor;
mod diagnosis;
mod endpoint;
mod follower;
mod genius;
mod line_rate;
mod link;
mod log_position;
mod open;
mod ports;
mod range_reader;
pub mod reader;
mod request_error;
mod serial;
pub mod session;
mod tcp;
mod text_line;
mod transport;
mod unit;
mod unsolicited;
pub mod watcher;

pub use clock::{Clock, RealTime};
pub use counters::Counters;
pub use cursor::{Cursor, Delivery, Lost};
pub use diagnosis::Diagnosis;
pub use endpoint::{Endpoint, EndpointError, GeniWindow};
pub use follower::{LogFollower, Step};
pub use genius::{BlockKind, BoardStatus, DeviceRecord, GeniusError};
#[cfg(unix)]
pub use genius::{BusDevice, BusRecorders, GeniHost, Recognition};
pub use line_rate::LineRate;
pub use log_position::LogPosition;
pub use open::{OpenError, open};
pub use ports::{PortInfo, ports};
pub use range_reader::RangeReader;
pub use reader::{Disturbed, LogReader, ReadRequest, Summary};
pub use request_error::RequestError;
pub use serial::SerialTransport;
pub use session::{Attempt, Busy, NoReply, Session, Timing};
pub use tcp::TcpTransport;
pub use text_line::{LineAssembler, MAX_LINE_LEN, TextLine};
pub use transport::{Transport, TransportError};
pub use unit::{Options, Unit};
pub use unsolicited::Unsolicited;
pub use watcher::{LogWatcher, ReportSwitch};
