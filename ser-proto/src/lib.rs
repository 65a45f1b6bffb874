//! The language of the sequential event recorder (SER): the messages between a host and a recorder.
//!
//! A message is a *body*: a command byte and its parameters, the same on every medium. A
//! [`Command`] is a body on its way to the recorder, a [`Reply`] one on its way back. Both `parse`
//! from bytes and turn back into them with `to_body`. On RS-232 a body travels in an ESC frame.
//! [`FrameEncoder`] makes one; [`FrameDecoder`] finds them in a stream that may also hold text
//! lines and noise.
//!
//! Nothing here performs I/O, reads a clock, allocates or panics, whatever the bytes are.
//!
//! Seven commands are those of the manual. Four are an extension of this project
//! ([`Code::is_of_extension`]), which original recorders do not know; `docs/protocol.md` says when a
//! host may send them.
//!
//! Page and table names in the documentation refer to the HE660SER160/320 product manual ("the
//! manual").
#![cfg_attr(not(test), no_std)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod body;
mod capabilities;
mod clock_reading;
mod clock_source;
mod code;
mod command;
mod configuration;
mod counter;
mod diagnostics;
mod entry;
mod error;
mod fields;
mod filters;
mod frame_decoder;
mod frame_encoder;
pub mod genius;
mod identity;
mod input_filter;
mod last_broadcast;
mod mode;
mod model;
mod params;
mod read_reply;
mod recorder_id;
mod reply;
mod time_stamp;

pub use body::{Body, LONGEST_READ_REPLY, MAX_BODY_LEN};
pub use capabilities::Capabilities;
pub use clock_reading::{ClockReading, Mark};
pub use clock_source::ClockSource;
pub use code::Code;
pub use command::Command;
pub use configuration::{AutoReport, Baud, Configuration, Configure, MAX_REPORT_ADDRESS, MAX_SIZE};
pub use counter::{Counter, CounterGroup, CounterWeight};
pub use diagnostics::{Counters, MAX_COUNTERS};
pub use entry::{Entry, InputNumbers, Inputs};
pub use error::ParseError;
pub use filters::{Filters, MAX_FILTERS};
pub use frame_decoder::{Decoded, DroppedFrame, FrameDecoder, FrameError};
pub use frame_encoder::{ESC, FrameEncoder, encoded_len};
pub use identity::{EXTENSION_LEVEL, FirmwareVersion, Guard, Identity};
pub use input_filter::{
    ChatterFilter, InputFilter, InvalidFilter, MAX_CHATTER_CHANGES, MAX_CHATTER_WINDOW_MS,
};
pub use last_broadcast::LastBroadcast;
pub use mode::Mode;
pub use model::Model;
pub use read_reply::{MAX_ENTRIES, READ_REPLY_HEADER_LEN, ReadReply};
pub use recorder_id::RecorderId;
pub use reply::Reply;
pub use time_stamp::{InvalidTime, TimeStamp};
