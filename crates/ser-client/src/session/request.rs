//! A request, its state, and its attempts.

use std::num::NonZeroU8;
use std::time::Duration;

use ser_proto::genius::MAX_SER_DATA;
use ser_proto::{
    Command, FrameEncoder, MAX_ENTRIES, Model, ParseError, Reply, TimeStamp, encoded_len,
};

use super::counters::Counters;
use super::exchange::{Beginning, Exchange};
use crate::transport::line_rate::LineRate;

/// A request whose answer has not come.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) command: Command,
    /// Whether each attempt gets its own time.
    pub(super) wants_time: bool,
    pub(super) repeat: bool,
    /// How often it was sent.
    pub(super) sent: u32,
    /// Just before the first attempt was sent.
    pub(super) first_sent: Duration,
    /// Just before the last attempt was sent.
    pub(super) last_sent: Duration,
    /// How many attempts have failed.
    pub(super) failed: u32,
    /// Whether an attempt is under way; otherwise one must be sent.
    pub(super) under_way: bool,
    /// Whether another request was under way when this one was sent.
    pub(super) behind: bool,
    /// The counters at the first attempt.
    pub(super) before: Counters,
    pub(super) not_understood: Option<ParseError>,
}

impl Request {
    /// A request that has not been sent.
    pub(super) fn new(
        command: Command,
        repeat: bool,
        wants_time: bool,
        before: Counters,
    ) -> Request {
        Request {
            command,
            wants_time,
            repeat,
            sent: 0,
            first_sent: Duration::ZERO,
            last_sent: Duration::ZERO,
            failed: 0,
            under_way: false,
            behind: false,
            before,
            not_understood: None,
        }
    }

    pub(super) fn is_answered_by(&self, reply: &Reply) -> bool {
        match (&self.command, reply) {
            _ if self.sent == 0 => false,
            (&Command::Read { start, count }, Reply::Read(reply)) => {
                reply.start == start && reply.entries.len() <= usize::from(count)
            }
            (&Command::Time { token }, Reply::Time(reading)) => reading.token == token,
            (&Command::QueryFilters { first }, Reply::Filters(filters)) => filters.first == first,
            (&Command::SetFilter { input, .. }, Reply::Filters(filters)) => {
                filters.first == input.unwrap_or(NonZeroU8::MIN)
            }
            // The reply passes over ids that the recorder does not have.
            (&Command::Diagnostics { first }, Reply::Diagnostics(counters)) => {
                counters.first >= first
            }
            (command, reply) => command.code() == reply.code(),
        }
    }

    pub(super) fn is_read(&self) -> bool {
        matches!(self.command, Command::Read { .. })
    }

    /// When it was asked and answered.
    pub(super) fn exchange(
        &self,
        now: Duration,
        reply: Beginning,
        line_rate: LineRate,
    ) -> Exchange {
        let request = encoded_len(self.command.to_body().len());
        let times = (self.first_sent, self.last_sent, now);
        Exchange::new(self.sent, times, request, reply, line_rate)
    }

    /// Marks the attempt under way as failed.
    pub(super) fn ask_again(&mut self) {
        self.under_way = false;
        self.behind = false;
    }
}

/// An attempt that must be sent now.
#[derive(Debug)]
pub struct Attempt<'a> {
    pub(super) request: &'a mut Request,
    pub(super) frame: &'a mut Vec<u8>,
    pub(super) line_rate: LineRate,
}

impl Attempt<'_> {
    /// Which attempt this is, from 1.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.request.sent
    }

    /// How long the frame is on the line.
    #[must_use]
    pub fn duration(&self) -> Duration {
        self.line_rate.time_for(self.frame.len())
    }

    /// Whether the attempt needs a time because it sets the clock.
    #[must_use]
    pub fn wants_time(&self) -> bool {
        self.request.wants_time
    }

    /// Sets the time at which the frame's last byte arrives: the present plus
    /// [`duration`](Self::duration). Attempts that need no time stay unchanged.
    pub fn set_time(&mut self, time: TimeStamp) {
        if self.request.wants_time {
            self.request.command = Command::SetClock(time);
            encode(&self.request.command, self.frame);
        }
    }

    /// The command to send, for a connection without frames.
    #[must_use]
    pub fn command(&self) -> &Command {
        &self.request.command
    }

    /// The bytes to send.
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        self.frame
    }
}

/// Bytes of the longest body that can answer `command`.
pub(super) fn longest_reply(command: &Command) -> usize {
    match command {
        Command::Read { count, .. } => {
            Model::Ser320.read_reply_len(usize::from(*count).min(MAX_ENTRIES))
        }
        Command::QueryConfiguration | Command::Configure(_) | Command::LastBroadcast => 7,
        Command::QueryMode | Command::SetMode { .. } => 3,
        // Some recorders echo the parameters of a print command.
        Command::Print { .. } => 5,
        Command::Erase | Command::SetClock(_) => 1,
        // A reply of the extension may have grown, as long as a datagram has room for it.
        Command::Identify
        | Command::Time { .. }
        | Command::QueryFilters { .. }
        | Command::SetFilter { .. }
        | Command::Diagnostics { .. } => MAX_SER_DATA,
    }
}

pub(super) const fn may_be_repeated(command: &Command) -> bool {
    match command {
        // A recorder that may not know the extension is asked once who it is. A reading of the
        // clock is one of the moment at which this question arrived, and of no other.
        Command::Erase
        | Command::Print { .. }
        | Command::SetClock(_)
        | Command::Identify
        | Command::Time { .. } => false,
        Command::Configure(configure) => configure.baud.is_none(),
        Command::QueryConfiguration
        | Command::LastBroadcast
        | Command::QueryMode
        | Command::SetMode { .. }
        | Command::Read { .. }
        | Command::QueryFilters { .. }
        | Command::SetFilter { .. }
        | Command::Diagnostics { .. } => true,
    }
}

pub(super) const fn changes_something(command: &Command) -> bool {
    match command {
        Command::Erase
        | Command::Print { .. }
        | Command::SetClock(_)
        | Command::Configure(_)
        | Command::SetMode { .. }
        | Command::SetFilter { .. } => true,
        Command::QueryConfiguration
        | Command::LastBroadcast
        | Command::QueryMode
        | Command::Read { .. }
        | Command::Identify
        | Command::Time { .. }
        | Command::QueryFilters { .. }
        | Command::Diagnostics { .. } => false,
    }
}

pub(super) fn encode(command: &Command, frame: &mut Vec<u8>) {
    frame.clear();
    frame.extend(FrameEncoder::new(command.to_body()));
}
