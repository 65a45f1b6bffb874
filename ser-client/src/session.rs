//! One request after the other and the answer to each, told apart from what the recorder says by itself.
//!
//! A session owns neither port nor clock. Give it a command with [`request`](Session::request); send what
//! [`dispatch`](Session::dispatch) hands out; give it what arrives with [`process`](Session::process); call
//! `dispatch` again when [`poll_at`](Session::poll_at) has come; take the result with
//! [`take_answer`](Session::take_answer). `now` is the time since any fixed moment, and never runs backwards.
//!
//! # Which answer belongs to which request
//!
//! The protocol has no transaction numbers. A reply answers the request under way if its command byte is the same;
//! a read reply must also begin at the entry that was asked for and hold no more entries than that. Every other
//! read reply is an auto report ([`Unsolicited::Report`]), every other reply is counted and forgotten.
//!
//! An auto report that is made after the question and begins at the same entry cannot be told from the answer. It need
//! not be: it says how the log stands now, and whoever reads goes on behind an answer that is short. A report from
//! before the question would be another matter, so [`Unit`](crate::Unit) takes what has arrived before it asks.
//!
//! A request that was repeated or given up may be answered after all, later. To a repeated read that does no harm:
//! each reply says where the log stood when it was made. But a *new* request of the same kind could take the old
//! answer for its own, and the next one the answer after that, and so on. Such a request is therefore held back until
//! the missing answers have come, or one more timeout has passed.
//!
//! # What is repeated
//!
//! Queries, reads, start, stop and settings are sent again when no answer comes. Not so:
//! - *Erase*: a repeated one could erase events that were recorded in between, unread;
//! - *Print*: everything would be printed twice;
//! - *Configure* with a baud rate: the unit may have changed the rate already, so the repeat would be garbage;
//! - *Set clock*, unless each attempt gets a time of its own: see [`Session::request_set_clock`].

use std::time::Duration;

use ser_proto::{
    Code, Command, Decoded, FrameDecoder, FrameEncoder, MAX_BODY_LEN, MAX_ENTRIES, Model, ParseError, Reply,
    TimeStamp, encoded_len,
};

use crate::text_line::LineAssembler;
use crate::unsolicited::UnsolicitedQueue;
use crate::{Counters, Diagnosis, LineRate, Unsolicited};

/// How much longer than its timeout an attempt may last because a frame is just arriving: the longest frame at the
/// lowest rate. It matters where the rate of the line is not known, as behind a terminal server.
const LONGEST_FRAME: Duration = Duration::from_millis(11_400);

/// A time that no unit accepts, until the attempt gets its own.
const NO_TIME: TimeStamp =
    TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };

/// How long to wait and how often to try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// How long a unit may take to answer, on top of the time that the bytes are on the line.
    pub timeout: Duration,
    /// How often a request is repeated, if it may be.
    pub retries: u32,
    /// The speed of the line.
    pub line_rate: LineRate,
}

impl Timing {
    /// How long one attempt lasts: the request on the line, a message that the unit was just sending, the longest
    /// answer, and the time to think.
    #[must_use]
    pub fn attempt(&self, command: &Command) -> Duration {
        let bytes = encoded_len(command.to_body().len())
            + encoded_len(MAX_BODY_LEN)
            + encoded_len(longest_reply(command));
        self.timeout.saturating_add(self.line_rate.time_for(bytes))
    }
}

/// Bytes of the longest body that can answer `command`.
fn longest_reply(command: &Command) -> usize {
    match command {
        Command::Read { count, .. } => Model::Ser320.read_reply_len(usize::from(*count).min(MAX_ENTRIES)),
        Command::QueryConfiguration | Command::Configure(_) | Command::LastBroadcast => 7,
        Command::QueryMode | Command::SetMode { .. } => 3,
        // Some units echo the parameters of a print command.
        Command::Print { .. } => 5,
        Command::Erase | Command::SetClock(_) => 1,
    }
}

const fn may_be_repeated(command: &Command) -> bool {
    match command {
        Command::Erase | Command::Print { .. } | Command::SetClock(_) => false,
        Command::Configure(configure) => configure.baud.is_none(),
        Command::QueryConfiguration
        | Command::LastBroadcast
        | Command::QueryMode
        | Command::SetMode { .. }
        | Command::Read { .. } => true,
    }
}

const fn changes_something(command: &Command) -> bool {
    match command {
        Command::Erase
        | Command::Print { .. }
        | Command::SetClock(_)
        | Command::Configure(_)
        | Command::SetMode { .. } => true,
        Command::QueryConfiguration | Command::LastBroadcast | Command::QueryMode | Command::Read { .. } => {
            false
        }
    }
}

/// A request is under way, or its answer has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

/// No answer came, however often the request was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoReply {
    /// The command.
    pub command: Code,
    /// How often it was sent.
    pub attempts: u32,
    /// What the line looked like meanwhile.
    pub diagnosis: Diagnosis,
    /// Whether the command changes something, and so may have done it.
    pub may_have_been_done: bool,
}

/// The request under way.
#[derive(Debug)]
struct Request {
    command: Command,
    /// Whether each attempt is given a time of its own.
    wants_time: bool,
    repeat: bool,
    attempts: u32,
    /// When the attempt under way ends; before the first attempt there is none.
    deadline: Option<Duration>,
    /// What the counters were at the first attempt.
    before: Counters,
    not_understood: Option<ParseError>,
}

impl Request {
    fn is_answered_by(&self, reply: &Reply) -> bool {
        match (&self.command, reply) {
            _ if self.deadline.is_none() => false,
            (&Command::Read { start, count }, Reply::Read(reply)) => {
                reply.start == start && reply.entries.len() <= usize::from(count)
            }
            (command, reply) => command.code() == reply.code(),
        }
    }
}

/// Answers that may still come although nobody waits for them any more.
#[derive(Debug)]
struct Owed {
    code: Code,
    /// Where a read began.
    start: Option<u16>,
    replies: u32,
    until: Duration,
}

impl Owed {
    fn could_answer(&self, command: &Command) -> bool {
        self.code == command.code() && self.start == read_start(command)
    }

    fn is(&self, reply: &Reply) -> bool {
        let start = match reply {
            Reply::Read(reply) => Some(reply.start),
            _ => None,
        };
        self.code == reply.code() && self.start == start
    }
}

const fn read_start(command: &Command) -> Option<u16> {
    match command {
        Command::Read { start, .. } => Some(*start),
        _ => None,
    }
}

/// A frame that wants to be sent now.
#[derive(Debug)]
pub struct Attempt<'a> {
    request: &'a mut Request,
    frame: &'a mut Vec<u8>,
    line_rate: LineRate,
}

impl Attempt<'_> {
    /// Which attempt this is, from 1.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.request.attempts
    }

    /// How long the frame is on the line.
    #[must_use]
    pub fn duration(&self) -> Duration {
        self.line_rate.time_for(self.frame.len())
    }

    /// Whether the attempt has to be given a time: it sets the clock.
    #[must_use]
    pub fn wants_time(&self) -> bool {
        self.request.wants_time
    }

    /// Gives the attempt its time, the one at which the last byte of the frame arrives: now and
    /// [`duration`](Self::duration). Other attempts than those that want a time stay as they are.
    pub fn set_time(&mut self, time: TimeStamp) {
        if self.request.wants_time {
            self.request.command = Command::SetClock(time);
            encode(&self.request.command, self.frame);
        }
    }

    /// The command to send, where that is done without a frame.
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

/// The reply in a body, or which one it seemed to be.
fn understand(body: &[u8]) -> Result<Reply, (Option<u8>, ParseError)> {
    Reply::parse(body).map_err(|error| (body.first().copied(), error))
}

fn encode(command: &Command, frame: &mut Vec<u8>) {
    frame.clear();
    frame.extend(FrameEncoder::new(command.to_body()));
}

/// A conversation over one line; see the [module documentation](self).
#[derive(Debug)]
pub struct Session {
    timing: Timing,
    decoder: FrameDecoder<MAX_BODY_LEN>,
    lines: LineAssembler,
    counters: Counters,
    last_byte_at: Duration,
    request: Option<Request>,
    answer: Option<Result<Reply, NoReply>>,
    owed: Option<Owed>,
    unsolicited: UnsolicitedQueue,
    frame: Vec<u8>,
}

impl Session {
    /// A session that has not said anything yet.
    #[must_use]
    pub fn new(timing: Timing) -> Session {
        Session {
            timing,
            decoder: FrameDecoder::new(),
            lines: LineAssembler::default(),
            counters: Counters::default(),
            last_byte_at: Duration::ZERO,
            request: None,
            answer: None,
            owed: None,
            unsolicited: UnsolicitedQueue::default(),
            frame: Vec::new(),
        }
    }

    /// Begins a request. [`dispatch`](Self::dispatch) sends it.
    ///
    /// # Errors
    /// One at a time: when another one is under way, or its answer has not been taken.
    pub fn request(&mut self, command: Command) -> Result<(), Busy> {
        self.begin(command, may_be_repeated(&command), false)
    }

    /// Begins to set the clock. Unlike a [`Command::SetClock`] this is repeated, because each [`Attempt`] wants a
    /// time of its own.
    ///
    /// # Errors
    /// As for [`request`](Self::request).
    pub fn request_set_clock(&mut self) -> Result<(), Busy> {
        self.begin(Command::SetClock(NO_TIME), true, true)
    }

    fn begin(&mut self, command: Command, repeat: bool, wants_time: bool) -> Result<(), Busy> {
        if self.request.is_some() || self.answer.is_some() {
            return Err(Busy);
        }
        self.request = Some(Request {
            command,
            wants_time,
            repeat,
            attempts: 0,
            deadline: None,
            before: self.counters,
            not_understood: None,
        });
        Ok(())
    }

    /// Does what is due: hands out a frame to send, or gives the request up.
    pub fn dispatch(&mut self, now: Duration) -> Option<Attempt<'_>> {
        if self.owed.as_ref().is_some_and(|owed| now >= owed.until) {
            self.owed = None;
        }
        if self.poll_at()? > now {
            return None;
        }
        let retries = self.timing.retries;
        if self.request.as_ref().is_some_and(|r| r.attempts > 0 && (!r.repeat || r.attempts > retries)) {
            self.give_up(now);
            return None;
        }
        let request = self.request.as_mut()?;
        if request.attempts == 0 {
            request.before = self.counters;
        }
        request.attempts += 1;
        request.deadline = Some(now.saturating_add(self.timing.attempt(&request.command)));
        encode(&request.command, &mut self.frame);
        Some(Attempt { request, frame: &mut self.frame, line_rate: self.timing.line_rate })
    }

    /// When to call [`dispatch`](Self::dispatch) again, if nothing arrives before; a moment in the past means at
    /// once. `None` while there is no request.
    #[must_use]
    pub fn poll_at(&self) -> Option<Duration> {
        let request = self.request.as_ref()?;
        let Some(deadline) = request.deadline else {
            let held_back = self.owed.as_ref().filter(|owed| owed.could_answer(&request.command));
            return Some(held_back.map_or(Duration::ZERO, |owed| owed.until));
        };
        if !self.decoder.inside_frame() {
            return Some(deadline);
        }
        let end_of_frame = self.last_byte_at.saturating_add(self.timing.timeout);
        Some(end_of_frame.min(deadline.saturating_add(LONGEST_FRAME)).max(deadline))
    }

    /// Takes bytes that have arrived, cut in any way.
    pub fn process(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            self.counters.bytes += 1;
            self.last_byte_at = now;
            let message = match self.decoder.push(byte) {
                None => continue,
                Some(Decoded::Text(byte)) => {
                    self.take_text(byte);
                    continue;
                }
                Some(Decoded::Dropped(dropped)) => {
                    self.counters.dropped(dropped.cause);
                    // What is left of the frame would pass for text.
                    self.lines.damaged();
                    continue;
                }
                Some(Decoded::Frame(body)) => understand(body),
            };
            self.take_message(now, message);
        }
    }

    /// Takes a body that has arrived without a frame, as on a Genius bus.
    pub fn process_body(&mut self, now: Duration, body: &[u8]) {
        self.counters.bytes += body.len() as u64;
        self.take_message(now, understand(body));
    }

    fn take_message(&mut self, now: Duration, message: Result<Reply, (Option<u8>, ParseError)>) {
        self.counters.frames += 1;
        match message {
            Ok(reply) => self.take_reply(now, reply),
            Err((code, error)) => self.take_nonsense(code, error),
        }
    }

    fn take_text(&mut self, byte: u8) {
        if !matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~') {
            self.counters.noise += 1;
        }
        if let Some(line) = self.lines.push(byte) {
            self.counters.lines += u64::from(line.noise == 0);
            self.unsolicited.push(Unsolicited::Line(line));
        }
    }

    fn take_nonsense(&mut self, code: Option<u8>, error: ParseError) {
        self.counters.not_understood += 1;
        if let Some(request) = &mut self.request
            && code == Some(request.command.code().byte())
        {
            request.not_understood = Some(error);
        }
    }

    fn take_reply(&mut self, now: Duration, reply: Reply) {
        if let Some(request) = self.request.take_if(|request| request.is_answered_by(&reply)) {
            let until = request.deadline.unwrap_or(now);
            self.remember_owed(&request, request.attempts - 1, until);
            if reply == Reply::PrintAccepted {
                // Nothing but their time tells earlier lines from those that were asked for.
                self.unsolicited.drop_lines();
                self.lines.clear();
            }
            self.answer = Some(Ok(reply));
            self.unsolicited.mark();
            return;
        }
        if let Some(owed) = &mut self.owed
            && owed.is(&reply)
        {
            owed.replies -= 1;
            if owed.replies == 0 {
                self.owed = None;
            }
        }
        if let Reply::Read(reply) = reply {
            self.counters.reports += 1;
            self.unsolicited.push(Unsolicited::Report(reply));
        } else {
            self.counters.stray_replies += 1;
        }
    }

    fn give_up(&mut self, now: Duration) {
        let Some(request) = self.request.take() else { return };
        let seen = self.counters.since(&request.before);
        self.remember_owed(&request, request.attempts, now.saturating_add(self.timing.timeout));
        self.answer = Some(Err(NoReply {
            command: request.command.code(),
            attempts: request.attempts,
            diagnosis: Diagnosis::of(&seen, request.not_understood, self.decoder.inside_frame()),
            may_have_been_done: changes_something(&request.command),
        }));
    }

    /// Forgets the request under way, as after an error of the line.
    pub fn cancel(&mut self, now: Duration) {
        self.answer = None;
        if let Some(request) = self.request.take() {
            self.remember_owed(&request, request.attempts, now.saturating_add(self.timing.timeout));
        }
    }

    fn remember_owed(&mut self, request: &Request, replies: u32, until: Duration) {
        if replies > 0 {
            let start = read_start(&request.command);
            self.owed = Some(Owed { code: request.command.code(), start, replies, until });
        }
    }

    /// The outcome of the request, once.
    pub fn take_answer(&mut self) -> Option<Result<Reply, NoReply>> {
        self.answer.take()
    }

    /// The oldest message that answers no request.
    pub fn take_unsolicited(&mut self) -> Option<Unsolicited> {
        self.unsolicited.pop()
    }

    /// Forgets the reports that came before the last answer. Messages come in the order in which the unit sent them, so
    /// these tell of a log that has changed since: the answer knows better.
    pub fn forget_earlier_reports(&mut self) {
        self.unsolicited.drop_reports_before_mark();
    }

    /// How many messages were dropped because nobody took them; 4096 are kept.
    #[must_use]
    pub const fn unsolicited_dropped(&self) -> u64 {
        self.unsolicited.dropped()
    }

    /// What has been seen on the line so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How long to wait and how often to try.
    #[must_use]
    pub const fn timing(&self) -> Timing {
        self.timing
    }

    /// Changes how long to wait and how often to try, from the next request on.
    pub fn set_patience(&mut self, timeout: Duration, retries: u32) {
        self.timing.timeout = timeout;
        self.timing.retries = retries;
    }

    /// Tells that the line has another rate now. What was under way at the old rate is forgotten.
    pub fn set_line_rate(&mut self, line_rate: LineRate) {
        self.timing.line_rate = line_rate;
        if let Some(unfinished) = self.decoder.finish() {
            self.counters.dropped(unfinished.cause);
        }
        self.lines.clear();
        self.owed = None;
    }
}
