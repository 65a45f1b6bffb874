//! A recorder behind a line or on a bus: blocking calls, one per thing that it can do.
//!
//! A [`Unit`] drives a session over a link. It sends what is due, waits for what arrives, and
//! returns an error when no answer comes. `open` has the ways to open one.

pub(crate) mod extension;
mod open;
pub(crate) mod request_error;

use std::sync::Arc;
use std::time::Duration;

use ser_proto::{
    Baud, Code, Command, Configuration, Configure, LONGEST_READ_REPLY, LastBroadcast, Mode, Model,
    ReadReply, Reply, TimeStamp, encoded_len,
};

use crate::reading::delivery::Delivery;
use crate::reading::log_position::LogPosition;
use crate::reading::range_reader::RangeReader;
use crate::reading::read_request::ReadRequest;
use crate::session::change::{Change, ChangeHook, Outcome, Stage};
use crate::session::counters::Counters;
use crate::session::exchange::Exchange;
use crate::session::link::{Link, SerialLink};
use crate::session::options::Options;
use crate::session::unsolicited::Unsolicited;
use crate::session::{LONGEST_FRAME, NO_TIME, NoReply, Session, Timing};
use crate::transport::Transport;
use crate::transport::clock::{Clock, RealTime};
use crate::transport::line_rate::LineRate;
use crate::transport::transport_error::TransportError;
use extension::Extension;
use request_error::RequestError;

/// A recorder changes its rate after the reply. It would not understand what arrives at that
/// moment.
const BAUD_SETTLING: Duration = Duration::from_millis(20);

/// On a bus a report may wait behind those of others. Longer than that no datagram waits.
const REPORT_ON_BUS: Duration = Duration::from_secs(20);

/// How long a recorder may take to answer while its rate is being searched for, on top of the time
/// that the bytes are on the line.
const SEARCH_TIMEOUT: Duration = Duration::from_millis(250);

/// The time for an attempt to set the clock that arrives after this delay.
type TimeAt<'a> = &'a mut dyn FnMut(Duration) -> Result<TimeStamp, RequestError>;

/// A connection to a recorder, over a line or a bus.
pub struct Unit {
    link: Box<dyn Link>,
    session: Session,
    /// Whether the recorder has answered a command of the manual.
    has_answered: bool,
    extension: Extension,
    /// Is told of everything that changes the recorder.
    on_change: Option<ChangeHook>,
    /// Whether anything of the present request may have left this host.
    may_have_left: bool,
    /// That of the last question about the clock.
    token: u16,
    /// Where the log stood after the last reading by cursor.
    pub(crate) last_position: Option<LogPosition>,
}

impl Unit {
    /// A recorder behind `transport`. Nothing is sent yet.
    #[must_use]
    pub fn new(transport: Box<dyn Transport>, options: Options) -> Unit {
        Unit::with_clock(transport, options, Arc::new(RealTime::new()))
    }

    /// A recorder behind a transport that does not run in this computer's time.
    #[must_use]
    pub fn with_clock(
        transport: Box<dyn Transport>,
        options: Options,
        clock: Arc<dyn Clock>,
    ) -> Unit {
        let Options { timeout, retries } = options;
        let line_rate = LineRate::from(transport.bits_per_second());
        let session = Session::new(Timing { timeout, retries, line_rate });
        Unit::over(Box::new(SerialLink::new(transport, clock)), session)
    }

    /// A recorder at the other end of a link.
    fn over(link: Box<dyn Link>, session: Session) -> Unit {
        Unit {
            link,
            session,
            has_answered: false,
            extension: Extension::default(),
            on_change: None,
            may_have_left: false,
            token: 0,
            last_position: None,
        }
    }

    /// This host's own bus address, if the recorder is on a Genius bus. Auto reports can be sent
    /// there.
    #[must_use]
    pub fn bus_address(&self) -> Option<u8> {
        self.link.bus_address()
    }

    /// Sends a command and waits for the reply. A [`Command::SetClock`] is sent once, with the time
    /// that it holds; [`set_clock`](Self::set_clock) is more exact.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn request(&mut self, command: &Command) -> Result<Reply, RequestError> {
        self.carry_out(command, None)
    }

    /// Has every change of the recorder by this connection told to `hook`: before it is sent, and
    /// with what came of it, before the caller learns of that. A command that is repeated is one
    /// change.
    pub fn on_change(&mut self, hook: ChangeHook) {
        self.on_change = Some(hook);
    }

    /// Whether the recorder records, and its version. Original recorders do not answer this query.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn mode(&mut self) -> Result<Mode, RequestError> {
        match self.request(&Command::QueryMode)? {
            Reply::Mode(mode) => Ok(mode),
            _ => Err(unexpected(Code::Mode)),
        }
    }

    /// Starts or stops recording.
    ///
    /// # Errors
    /// If no reply comes, the recorder stays in the other mode, or the line fails.
    pub fn set_recording(&mut self, recording: bool) -> Result<Mode, RequestError> {
        match self.request(&Command::SetMode { recording })? {
            Reply::Mode(mode) if mode.recording == recording => Ok(mode),
            _ => Err(unexpected(Code::Mode)),
        }
    }

    /// The settings in force. Original recorders do not answer this query.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn configuration(&mut self) -> Result<Configuration, RequestError> {
        match self.request(&Command::QueryConfiguration)? {
            Reply::Configuration(configuration) => Ok(configuration),
            _ => Err(unexpected(Code::Configure)),
        }
    }

    /// Changes the settings and returns those in force. The command for a new baud rate is sent
    /// only once, and this side changes to the new rate as soon as the reply has come.
    ///
    /// # Errors
    /// If no reply comes, the recorder refuses the settings, the line fails, or the port does not
    /// have the new rate.
    pub fn configure(&mut self, configure: Configure) -> Result<Configuration, RequestError> {
        let Reply::Configuration(in_force) = self.request(&Command::Configure(configure))? else {
            return Err(unexpected(Code::Configure));
        };
        let rate = in_force.baud.bits_per_second();
        if configure.baud == Some(in_force.baud)
            && self.link.bits_per_second().is_some_and(|now| now != rate)
        {
            self.set_baud(rate)?;
            self.listen_for(BAUD_SETTLING)?;
        }
        // A field that the command leaves open always agrees with the settings in force.
        if configure.apply_to(&in_force) == in_force {
            Ok(in_force)
        } else {
            Err(RequestError::Refused { in_force })
        }
    }

    /// Sets the clock. `time_at` gets a delay and returns the time after it, at which the last byte
    /// arrives at the recorder. It is called again for each attempt. Returns the time that was set
    /// last.
    ///
    /// # Errors
    /// If `time_at` fails, no reply comes or the line fails.
    pub fn set_clock(
        &mut self,
        mut time_at: impl FnMut(Duration) -> TimeStamp,
    ) -> Result<TimeStamp, RequestError> {
        let mut sent = None;
        self.carry_out(
            &Command::SetClock(NO_TIME),
            Some(&mut |delay| {
                let time = time_at(delay);
                time.check().map_err(RequestError::InvalidTime)?;
                sent = Some(time);
                Ok(time)
            }),
        )?;
        sent.ok_or_else(|| unexpected(Code::SetClock))
    }

    /// Erases the log. The command is sent once. Without a reply it may or may not have been
    /// carried out.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn erase(&mut self) -> Result<(), RequestError> {
        self.request(&Command::Erase).map(drop)
    }

    /// The command that the recorder last received as a broadcast, if any.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn last_broadcast(&mut self) -> Result<Option<LastBroadcast>, RequestError> {
        match self.request(&Command::LastBroadcast)? {
            Reply::LastBroadcast(last) => Ok(last),
            _ => Err(unexpected(Code::LastBroadcast)),
        }
    }

    /// Has entries printed. The lines come through [`wait_event`](Self::wait_event); lines from
    /// before the recorder's reply are dropped. The command is sent once.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn print(&mut self, start: u16, count: u16) -> Result<(), RequestError> {
        self.request(&Command::Print { start, count }).map(drop)
    }

    /// Where the log stands.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn log_position(&mut self) -> Result<LogPosition, RequestError> {
        self.read(ReadRequest::POSITION).map(|reply| LogPosition::from(&reply))
    }

    /// Reads the existing entries of a range of physical numbers and returns their count.
    ///
    /// # Errors
    /// If no reply comes or the line fails.
    pub fn read_range(
        &mut self,
        start: u16,
        count: u16,
        size: u16,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<u16, RequestError> {
        let mut reader = RangeReader::new(start, count, size);
        while let Some(request) = reader.request() {
            reader.take(&self.read(request)?, on);
        }
        Ok(reader.delivered())
    }

    /// Waits for the next message that answers no request: an auto report or a line of text.
    /// Messages that came during requests are returned first. A reading by cursor drops all reports
    /// from before it, because it delivers their events. `None` if nothing comes in time.
    ///
    /// # Errors
    /// If the line fails.
    pub fn wait_event(&mut self, timeout: Duration) -> Result<Option<Unsolicited>, RequestError> {
        let until = self.now().saturating_add(timeout);
        loop {
            if let Some(message) = self.session.take_unsolicited() {
                return Ok(Some(message));
            }
            let left = until.saturating_sub(self.now());
            if self.receive(left)? == 0 && left.is_zero() {
                return Ok(None);
            }
        }
    }

    /// Changes the rate on this side only.
    ///
    /// # Errors
    /// If the port does not have this rate.
    pub fn set_baud(&mut self, bits_per_second: u32) -> Result<(), RequestError> {
        self.link.set_baud(bits_per_second)?;
        self.session.set_line_rate(LineRate::from(self.link.bits_per_second()));
        Ok(())
    }

    /// Searches for the rate of a recorder that does not answer: asks once at every other rate.
    /// `None` if it answers at none of them, or the line has no rate. The search takes at most six
    /// seconds, unless the line is noisy. The rate is then what it was before.
    ///
    /// # Errors
    /// If the line fails.
    pub fn find_baud(&mut self) -> Result<Option<Baud>, RequestError> {
        let Some(usual) = self.bits_per_second() else { return Ok(None) };
        let Timing { timeout, retries, .. } = self.session.timing();
        let others = Baud::ALL.into_iter().rev().filter(|baud| baud.bits_per_second() != usual);
        let found = self.first_answering(others);
        self.session.set_patience(timeout, retries);
        self.set_baud(usual)?;
        found
    }

    fn first_answering(
        &mut self,
        rates: impl Iterator<Item = Baud>,
    ) -> Result<Option<Baud>, RequestError> {
        // Every recorder answers a read, even an original one.
        let question = Command::Read { start: 1, count: 1 };
        let bytes =
            encoded_len(question.to_body().len()) + encoded_len(Model::Ser320.read_reply_len(1));
        for baud in rates {
            // A port need not have every rate that recorders have.
            if self.set_baud(baud.bits_per_second()).is_err() {
                continue;
            }
            let line_rate = LineRate::BitsPerSecond(baud.bits_per_second());
            // A session also waits for the longest message that the recorder may be sending; at 300
            // baud that is too long for a guess.
            self.session.set_line_rate(LineRate::Instant);
            self.session.set_patience(SEARCH_TIMEOUT + line_rate.time_for(bytes), 0);
            match self.request(&question) {
                Ok(_) => return Ok(Some(baud)),
                Err(RequestError::NoReply { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// Sets the speed of a line that the transport cannot tell, as with a terminal server.
    pub fn set_line_rate(&mut self, line_rate: LineRate) {
        self.session.set_line_rate(line_rate);
    }

    /// The rate of the line, if it has one.
    #[must_use]
    pub fn bits_per_second(&self) -> Option<u32> {
        self.link.bits_per_second()
    }

    /// How old an auto report may be that was already on its way when a question was asked. If it
    /// begins at the same entry, it passes for the answer.
    #[must_use]
    pub fn report_delay(&self) -> Duration {
        match self.session.timing().line_rate {
            _ if self.bus_address().is_some() => REPORT_ON_BUS,
            LineRate::Instant => LONGEST_FRAME,
            rate => rate.time_for(encoded_len(LONGEST_READ_REPLY)),
        }
    }

    /// When the last reply was asked for and came; `None` before the first.
    #[must_use]
    pub fn last_exchange(&self) -> Option<Exchange> {
        let exchange = self.session.exchange();
        exchange.map(|exchange| match self.link.keeps_rate() {
            true => exchange,
            false => exchange.without_rate(),
        })
    }

    /// What has been seen on the line so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.session.counters()
    }

    /// How many reports and lines were dropped because [`wait_event`](Self::wait_event) did not
    /// take them in time.
    #[must_use]
    pub fn unsolicited_dropped(&self) -> u64 {
        self.session.unsolicited_dropped()
    }

    /// Forgets the auto reports that came before the last answer.
    pub(crate) fn forget_earlier_reports(&mut self) {
        self.session.forget_earlier_reports();
    }

    /// Whether reads go one at a time, because the recorder does not take a request while it
    /// answers another one, or because it is on a Genius bus. Otherwise two are under way, and the
    /// line is never silent.
    #[must_use]
    pub fn reads_one_at_a_time(&self) -> bool {
        self.session.is_one_at_a_time()
    }

    /// Sends the requests that `next` returns while there is room for more reads, without waiting.
    pub(crate) fn ask(
        &mut self,
        next: &mut dyn FnMut() -> Option<ReadRequest>,
    ) -> Result<(), RequestError> {
        if !self.session.has_room() {
            return Ok(());
        }
        if self.session.is_idle() {
            self.prepare()?;
        }
        while self.session.has_room()
            && let Some(request) = next()
        {
            // The loop condition ensures that there is room.
            let _ = self.session.request(request.into());
        }
        self.send_due(&mut |_| Err(unexpected(Code::Read)))
    }

    /// The reply to one of the reads under way.
    pub(crate) fn next_reply(&mut self) -> Result<ReadReply, RequestError> {
        match self.converse(&mut |_| Err(unexpected(Code::Read)))? {
            Reply::Read(reply) => Ok(reply),
            _ => Err(unexpected(Code::Read)),
        }
    }

    /// Forgets the requests under way.
    pub(crate) fn cancel(&mut self) {
        self.session.cancel(self.now());
    }

    pub(crate) fn read(&mut self, request: ReadRequest) -> Result<ReadReply, RequestError> {
        match self.request(&request.into())? {
            Reply::Read(reply) => Ok(reply),
            _ => Err(unexpected(Code::Read)),
        }
    }

    /// Takes what arrived before the request, because it cannot answer a later one. A request that
    /// an error of the line has cut short is forgotten.
    fn prepare(&mut self) -> Result<(), RequestError> {
        self.session.cancel(self.now());
        Ok(self.link.receive_waiting(&mut self.session)?)
    }

    /// Sends a command and waits for what comes of it. All commands but reads ahead go this way, so
    /// none that changes the recorder passes [the hook](Self::on_change). With `time_at` the clock
    /// is set, and each attempt gets its own time.
    fn carry_out(
        &mut self,
        command: &Command,
        time_at: Option<TimeAt<'_>>,
    ) -> Result<Reply, RequestError> {
        self.may_have_left = false;
        let mut command = *command;
        if let (Some(hook), Some(change)) = (&mut self.on_change, Change::of(&command)) {
            hook(&change, Stage::Begins);
        }
        let result = match time_at {
            None => self.ask_once(&command),
            Some(time_at) => self.set_clock_by(&mut |delay| {
                let time = time_at(delay)?;
                command = Command::SetClock(time);
                Ok(time)
            }),
        };
        if let (Some(hook), Some(change)) = (&mut self.on_change, Change::of(&command)) {
            let outcome = match &result {
                Ok(reply) => change.answered(reply),
                Err(error) if self.may_have_left => Outcome::NotAnswered(error.to_string()),
                Err(error) => Outcome::NotSent(error.to_string()),
            };
            hook(&change, Stage::Ended(&outcome));
        }
        result
    }

    fn ask_once(&mut self, command: &Command) -> Result<Reply, RequestError> {
        self.prepare()?;
        // Nothing else is under way now.
        let _ = self.session.request(*command);
        self.converse(&mut |_| Err(unexpected(command.code())))
    }

    fn set_clock_by(&mut self, time_at: TimeAt<'_>) -> Result<Reply, RequestError> {
        self.prepare()?;
        let _ = self.session.request_set_clock();
        self.converse(time_at)
    }

    fn converse(&mut self, time_at: TimeAt<'_>) -> Result<Reply, RequestError> {
        loop {
            self.send_due(time_at)?;
            match self.session.take_answer() {
                Some(Ok(reply)) => {
                    self.has_answered |= !reply.code().is_of_extension();
                    return Ok(reply);
                }
                Some(Err(no_reply)) => {
                    let diagnosis = self.link.diagnose(no_reply.diagnosis);
                    return Err(NoReply { diagnosis, ..no_reply }.into());
                }
                None => {}
            }
            let left = self.session.poll_at().unwrap_or_default().saturating_sub(self.now());
            self.receive(left)?;
        }
    }

    fn send_due(&mut self, time_at: TimeAt<'_>) -> Result<(), RequestError> {
        while let Some(mut attempt) = self.session.dispatch(self.link.now()) {
            if attempt.wants_time() {
                // Without a time nothing is sent, and the next request replaces this one.
                attempt.set_time(time_at(self.link.delay(&attempt))?);
            }
            let sent = self.link.send(&attempt);
            // A line that fails may have carried everything.
            self.may_have_left |= !sent.as_ref().is_err_and(TransportError::is_before_sending);
            sent?;
        }
        Ok(())
    }

    fn listen_for(&mut self, time: Duration) -> Result<(), RequestError> {
        let until = self.now().saturating_add(time);
        loop {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return Ok(());
            }
            self.receive(left)?;
        }
    }

    fn receive(&mut self, timeout: Duration) -> Result<usize, RequestError> {
        Ok(self.link.receive(&mut self.session, timeout)?)
    }

    /// The time by which the host waits for this recorder, from any start.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.link.now()
    }
}

const fn unexpected(command: Code) -> RequestError {
    RequestError::UnexpectedReply { command }
}
