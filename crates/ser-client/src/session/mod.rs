//! Requests and their answers, told apart from what the recorder sends by itself.
//!
//! A session owns neither port nor clock. Give it a command with [`request`](Session::request);
//! send what [`dispatch`](Session::dispatch) hands out; give it what arrives with
//! [`process`](Session::process); call `dispatch` again when [`poll_at`](Session::poll_at) has
//! come; take the result with [`take_answer`](Session::take_answer). `now` is the time since any
//! fixed moment, and never runs backwards.
//!
//! # Which answer belongs to which request
//!
//! The protocol has no transaction numbers. A reply answers the request under way if its command
//! byte is the same. A read reply must also begin at the entry that was asked for and hold no more
//! entries than that. Every other read reply is an auto report ([`Unsolicited::Report`]). Every
//! other reply is counted and forgotten.
//!
//! An auto report that is made after the question and begins at the same entry cannot be told from
//! the answer. That does no harm: it shows how the log stands now, and a reader continues after a
//! short answer. A report from before the question would do harm, so [`Unit`](crate::Unit) takes
//! what has arrived before it asks.
//!
//! A request that was repeated or given up may still be answered later. For a repeated read that
//! does no harm: each reply says where the log stood when it was made. But a *new* request of the
//! same kind could take the old answer for its own, and the next request the answer after that.
//! Such a request is therefore held back until the missing answers have come or one more timeout
//! has passed.
//!
//! # Two reads at once
//!
//! Reads may be [requested](Session::has_room) while another one is under way. The recorder then
//! finds the next request as soon as it has answered, and the line is never silent. All other
//! requests go one at a time.
//!
//! A recorder answers requests in their order, and a line keeps that order. So if a later request
//! is answered first, the earlier request or its answer was lost, and it is sent again at once.
//! Answers are [handed out](Session::take_answer) in the order in which they come. The time for an
//! answer begins when the one before it has come. A repeated request is the only one under way.
//!
//! A recorder need not take a request while it answers another one. When one of the first two goes
//! unanswered, requests go [one at a time](Session::is_one_at_a_time) for the rest of the session.
//! The trial does not count as an attempt and costs such a recorder at most one timeout. A recorder
//! that has taken some requests in this way may lose one, but not one in five. After eight without
//! a loss it is known to take them: a later loss was then the line's, and it is tried again after a
//! hundred answers.
//!
//! # What is repeated
//!
//! Queries, reads, start, stop and settings are sent again when no answer comes. These are not:
//! - *Erase*: a repeat could erase events that were recorded in between and not yet read;
//! - *Print*: everything would be printed twice;
//! - *Configure* with a baud rate: the recorder may have changed the rate already, so the repeat
//!   would be garbage;
//! - *Set clock*, unless each attempt gets its own time: see [`Session::request_set_clock`].
//!
//! # The files
//!
//! `request` knows what may be done with each command, `change` which of them change a recorder,
//! `exchange` when it was sent and answered, `owed` the late answers, and `pace` whether the
//! recorder takes two reads at once. `text_line`, `unsolicited`, `counters` and `diagnosis` hold
//! what else the line brings. A `link` is what a session needs of a line or a bus.

pub(crate) mod change;
pub(crate) mod counters;
pub(crate) mod diagnosis;
pub(crate) mod exchange;
pub(crate) mod link;
pub(crate) mod options;
mod owed;
mod pace;
mod request;
pub(crate) mod text_line;
pub(crate) mod unsolicited;

use std::collections::VecDeque;
use std::time::Duration;

use ser_proto::{
    Code, Command, Decoded, ESC, FrameDecoder, LONGEST_READ_REPLY, MAX_BODY_LEN, ParseError, Reply,
    TimeStamp, encoded_len,
};

use crate::transport::line_rate::LineRate;
use counters::Counters;
use diagnosis::Diagnosis;
use exchange::{Beginning, Exchange};
use owed::Owed;
use pace::Pace;
pub use request::Attempt;
use request::{Request, changes_something, encode, longest_reply, may_be_repeated};
use text_line::LineAssembler;
use unsolicited::{Unsolicited, UnsolicitedQueue};

/// Reads that may be under way at once.
const MAX_READS: usize = 2;

/// How much longer than its timeout an attempt may last because a frame is just arriving: the
/// longest frame that a recorder sends, at the lowest rate. It matters where the rate of the line
/// is unknown, as with a terminal server.
pub(crate) const LONGEST_FRAME: Duration = Duration::from_millis(11_400);

/// A time that no recorder accepts; it stands in until the attempt gets its own.
pub(crate) const NO_TIME: TimeStamp =
    TimeStamp { year: 0, month: 0, day: 0, hour: 0, minute: 0, second: 0, millisecond: 0 };

/// How long to wait and how often to try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// How long a recorder may take to answer, on top of the time that the bytes are on the line.
    pub timeout: Duration,
    /// How often a request is repeated, if it may be.
    pub retries: u32,
    /// The speed of the line.
    pub line_rate: LineRate,
}

impl Timing {
    /// How long one attempt lasts: the request on the line, a report that the recorder was just
    /// sending, the longest answer, and the time to think.
    #[must_use]
    pub fn attempt(&self, command: &Command) -> Duration {
        let bytes = encoded_len(command.to_body().len())
            + encoded_len(LONGEST_READ_REPLY)
            + encoded_len(longest_reply(command));
        self.timeout.saturating_add(self.line_rate.time_for(bytes))
    }
}

/// A request is under way that leaves no room for this one, or an answer has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

/// No answer came to any attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoReply {
    /// The command.
    pub command: Code,
    /// How often it was sent.
    pub attempts: u32,
    /// What the line looked like meanwhile.
    pub diagnosis: Diagnosis,
    /// Whether the command changes something and may have been carried out.
    pub may_have_been_done: bool,
}

/// The reply in a body, or the error with the command byte if there is one.
fn understand(body: &[u8]) -> Result<Reply, (Option<u8>, ParseError)> {
    Reply::parse(body).map_err(|error| (body.first().copied(), error))
}

/// A conversation with one recorder; see the [module documentation](self).
#[derive(Debug)]
pub struct Session {
    timing: Timing,
    decoder: FrameDecoder<MAX_BODY_LEN>,
    lines: LineAssembler,
    counters: Counters,
    last_byte_at: Duration,
    /// When the frame began that is arriving, or has just arrived.
    frame_began: Beginning,
    /// Those under way come first, in the order of sending.
    requests: VecDeque<Request>,
    /// When the attempt of the first request under way ends.
    deadline: Duration,
    answers: VecDeque<Result<(Reply, Exchange), NoReply>>,
    /// When the answer that was taken last was asked for and given.
    exchange: Option<Exchange>,
    pace: Pace,
    owed: Owed,
    unsolicited: UnsolicitedQueue,
    frame: Vec<u8>,
}

impl Session {
    /// A session that has not sent anything yet.
    #[must_use]
    pub fn new(timing: Timing) -> Session {
        Session {
            timing,
            decoder: FrameDecoder::new(),
            lines: LineAssembler::default(),
            counters: Counters::default(),
            last_byte_at: Duration::ZERO,
            frame_began: Beginning::at(Duration::ZERO),
            requests: VecDeque::new(),
            deadline: Duration::ZERO,
            answers: VecDeque::new(),
            exchange: None,
            pace: Pace::default(),
            owed: Owed::default(),
            unsolicited: UnsolicitedQueue::default(),
            frame: Vec::new(),
        }
    }

    /// The same session, but with only one request under way at a time, even for reads.
    #[must_use]
    pub fn one_at_a_time(self) -> Session {
        Session { pace: Pace::ONE_AT_A_TIME, ..self }
    }

    /// Whether only one request is under way at a time: because the caller wants it, or because the
    /// recorder does not take a request while it answers another one.
    #[must_use]
    pub const fn is_one_at_a_time(&self) -> bool {
        self.pace.is_one_at_a_time()
    }

    /// Begins a request. [`dispatch`](Self::dispatch) sends it.
    ///
    /// # Errors
    /// When another request is under way, unless both are reads and there [is
    /// room](Self::has_room), or when an answer has not been taken.
    pub fn request(&mut self, command: Command) -> Result<(), Busy> {
        self.begin(command, may_be_repeated(&command), false)
    }

    /// Whether a read may be requested now. Nothing else may be under way but fewer than two reads.
    #[must_use]
    pub fn has_room(&self) -> bool {
        // A repeated request is the only one under way.
        let may_be_joined = |request: &Request| request.is_read() && request.failed == 0;
        let room = if self.is_one_at_a_time() { 1 } else { MAX_READS };
        self.answers.is_empty()
            && self.requests.len() < room
            && self.requests.iter().all(may_be_joined)
    }

    /// Whether no answer is awaited or waiting to be taken.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.answers.is_empty() && self.requests.is_empty()
    }

    /// Begins to set the clock. Unlike a [`Command::SetClock`] this is repeated, because each
    /// [`Attempt`] asks for its own time.
    ///
    /// # Errors
    /// As for [`request`](Self::request).
    pub fn request_set_clock(&mut self) -> Result<(), Busy> {
        self.begin(Command::SetClock(NO_TIME), true, true)
    }

    fn begin(&mut self, command: Command, repeat: bool, wants_time: bool) -> Result<(), Busy> {
        let is_read = matches!(command, Command::Read { .. });
        let may_join = is_read && self.has_room();
        if !may_join && !self.is_idle() {
            return Err(Busy);
        }
        self.requests.push_back(Request::new(command, repeat, wants_time, self.counters));
        Ok(())
    }

    /// Does what is due: returns an attempt to send, or gives a request up. After an attempt
    /// another one may be due.
    pub fn dispatch(&mut self, now: Duration) -> Option<Attempt<'_>> {
        self.owed.expire(now);
        if self.attempt_ends_at().is_some_and(|end| end <= now) {
            self.time_out(now);
        }
        let (place, due) = self.next_to_send()?;
        if due > now {
            return None;
        }
        let request = self.requests.get_mut(place)?;
        if request.sent == 0 {
            request.before = self.counters;
            request.first_sent = now;
        }
        request.last_sent = now;
        request.sent += 1;
        request.under_way = true;
        request.behind = place > 0;
        if place == 0 {
            self.deadline = now.saturating_add(self.timing.attempt(&request.command));
        }
        encode(&request.command, &mut self.frame);
        Some(Attempt { request, frame: &mut self.frame, line_rate: self.timing.line_rate })
    }

    /// When to call [`dispatch`](Self::dispatch) again if nothing arrives before; a time in the
    /// past means at once. `None` while there is no request.
    #[must_use]
    pub fn poll_at(&self) -> Option<Duration> {
        let next = self.next_to_send().map(|(_, due)| due);
        self.attempt_ends_at().into_iter().chain(next).min()
    }

    /// When the attempt under way ends; of two, the first.
    fn attempt_ends_at(&self) -> Option<Duration> {
        self.requests.front().filter(|request| request.under_way)?;
        if !self.decoder.inside_frame() {
            return Some(self.deadline);
        }
        let end_of_frame = self.last_byte_at.saturating_add(self.timing.timeout);
        Some(end_of_frame.min(self.deadline.saturating_add(LONGEST_FRAME)).max(self.deadline))
    }

    /// The request to be sent next, and when.
    fn next_to_send(&self) -> Option<(usize, Duration)> {
        let place = self.requests.iter().position(|request| !request.under_way)?;
        // Two requests go together only if neither has failed before.
        let together = self.requests.iter().take(place + 1);
        if place > 0 && (self.is_one_at_a_time() || { together }.any(|request| request.failed > 0))
        {
            return None;
        }
        let held_back = self.owed.holds_back(&self.requests.get(place)?.command);
        Some((place, held_back.unwrap_or_default()))
    }

    /// Takes bytes that have arrived, in pieces of any size.
    pub fn process(&mut self, now: Duration, bytes: &[u8]) {
        for &byte in bytes {
            self.counters.bytes += 1;
            self.last_byte_at = now;
            if byte == ESC {
                self.frame_began = Beginning::at(now);
            }
            self.frame_began.take_byte(now, self.timing.line_rate);
            let message = match self.decoder.push(byte) {
                None => continue,
                Some(Decoded::Text(byte)) => {
                    self.take_text(byte);
                    continue;
                }
                Some(Decoded::Dropped(dropped)) => {
                    self.counters.dropped(dropped.cause);
                    // The remains of the frame would pass for text.
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
        self.frame_began = Beginning::at(now);
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
        if let Some(request) = self.requests.front_mut()
            && code == Some(request.command.code().byte())
        {
            request.not_understood = Some(error);
        }
    }

    fn take_reply(&mut self, now: Duration, reply: Reply) {
        let place = self.requests.iter().position(|request| request.is_answered_by(&reply));
        if let Some(place) = place {
            self.answered(now, place, reply);
            return;
        }
        self.owed.came(&reply);
        if let Reply::Read(reply) = reply {
            self.counters.reports += 1;
            self.unsolicited.push(Unsolicited::Report(reply));
        } else {
            self.counters.stray_replies += 1;
        }
    }

    fn answered(&mut self, now: Duration, place: usize, reply: Reply) {
        let Some(request) = self.requests.remove(place) else { return };
        let end = now.saturating_add(self.timing.attempt(&request.command));
        self.owed.remember(
            &request.command,
            request.sent - 1,
            if place == 0 { self.deadline } else { end },
        );
        if reply == Reply::PrintAccepted {
            // Only their time tells earlier lines from those that were asked for.
            self.unsolicited.drop_lines();
            self.lines.clear();
        }
        let exchange = request.exchange(now, self.frame_began, self.timing.line_rate);
        self.answers.push_back(Ok((reply, exchange)));
        self.unsolicited.mark();
        if place == 0 {
            self.pace.kept(request.behind);
        }
        // Otherwise it is the late answer to an earlier attempt and says nothing about later
        // requests.
        if request.under_way && place > 0 {
            self.passed_over(now, place);
        }
        if let Some(next) = self.requests.front() {
            self.deadline = now.saturating_add(self.timing.attempt(&next.command));
        }
    }

    /// A later request was answered before the first `count`, whose answers will not come any more.
    fn passed_over(&mut self, now: Duration, count: usize) {
        let free = self.pace.lost();
        for _ in 0..count {
            if let Some(mut request) = self.requests.pop_front() {
                request.ask_again();
                request.failed += u32::from(!free);
                let still_under_way =
                    self.requests.iter().take_while(|request| request.under_way).count();
                self.requests.insert(still_under_way, request);
            }
        }
        if let Some(hopeless) = self.requests.iter().position(|request| self.is_hopeless(request)) {
            self.give_up(now, hopeless);
        }
    }

    /// The first of the requests under way was not answered in time.
    fn time_out(&mut self, now: Duration) {
        let others = self.requests.iter().skip(1).any(|request| request.under_way);
        let Some(first) = self.requests.front_mut() else { return };
        let free = (first.behind || others) && self.pace.lost();
        first.failed += u32::from(!free);
        if self.requests.front().is_some_and(|first| self.is_hopeless(first)) {
            return self.give_up(now, 0);
        }
        self.requests.iter_mut().for_each(Request::ask_again);
    }

    fn is_hopeless(&self, request: &Request) -> bool {
        request.failed > if request.repeat { self.timing.retries } else { 0 }
    }

    /// Gives up the request at `place`, and all others with it.
    fn give_up(&mut self, now: Duration, place: usize) {
        let Some(request) = self.requests.get(place) else { return };
        let seen = self.counters.since(&request.before);
        let no_reply = NoReply {
            command: request.command.code(),
            attempts: request.sent,
            diagnosis: Diagnosis::of(&seen, request.not_understood, self.decoder.inside_frame()),
            may_have_been_done: changes_something(&request.command),
        };
        self.forget_requests(now);
        self.answers.push_back(Err(no_reply));
    }

    /// Forgets the requests under way, for example after an error of the line.
    pub fn cancel(&mut self, now: Duration) {
        self.answers.clear();
        self.forget_requests(now);
    }

    fn forget_requests(&mut self, now: Duration) {
        let until = now.saturating_add(self.timing.timeout);
        for request in self.requests.drain(..) {
            self.owed.remember(&request.command, request.sent, until);
        }
    }

    /// The outcome of a request, once. Of two reads, the start of the answer says which one it
    /// belongs to. When one is given up, so is the other.
    pub fn take_answer(&mut self) -> Option<Result<Reply, NoReply>> {
        let answer = self.answers.pop_front()?;
        Some(answer.map(|(reply, exchange)| {
            self.exchange = Some(exchange);
            reply
        }))
    }

    /// When the answer that was taken last was asked for and given.
    #[must_use]
    pub const fn exchange(&self) -> Option<Exchange> {
        self.exchange
    }

    /// The oldest message that answers no request.
    pub fn take_unsolicited(&mut self) -> Option<Unsolicited> {
        self.unsolicited.pop()
    }

    /// Forgets the reports that came before the last answer. Messages come in the order of sending,
    /// so these reports are older than the answer.
    pub fn forget_earlier_reports(&mut self) {
        self.unsolicited.drop_reports_before_mark();
    }

    /// How many messages were dropped because nobody took them. The session keeps 4096.
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

    /// Sets the rate of the line. Requests under way at the old rate are forgotten.
    pub fn set_line_rate(&mut self, line_rate: LineRate) {
        self.timing.line_rate = line_rate;
        if let Some(unfinished) = self.decoder.finish() {
            self.counters.dropped(unfinished.cause);
        }
        self.lines.clear();
        self.owed.clear();
    }
}
