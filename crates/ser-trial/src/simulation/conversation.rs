//! A host's conversation with one recorder: the client's own session and log reader, driven in
//! virtual time.

use std::time::Duration;

use ser_client::{
    Cursor, Delivery, Disturbed, LineRate, LogPosition, LogReader, Session, Timing, Unsolicited,
};
use ser_proto::{Command, Configuration, ReadReply, Reply, TimeStamp};

use super::account::{Account, Known};
use super::ledger::Ledger;

/// How often a reading begins anew because the log was changed under it. The client has the same
/// limit.
const MAX_RESYNCS: u32 = 4;

/// What a host wants from a recorder.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Everything that is new in the log.
    Read,
    /// The answer to a command.
    Ask(Command),
    /// To set the clock, with a different time for every attempt: this much later than the first.
    SetClock(TimeStamp),
}

/// What the host is doing.
enum Job {
    Rest,
    Read { reader: Box<LogReader>, resyncs: u32 },
    LearnSize { resyncs: u32 },
    Ask,
    SetClock(TimeStamp),
}

/// Counts of what happened in a conversation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Talk {
    /// Requests that were answered.
    pub answered: u64,
    /// Requests that were given up.
    pub unanswered: u64,
    /// Readings to the end of the log.
    pub readings: u64,
    /// Readings during which the log was erased or resized.
    pub disturbed: u64,
    /// Read replies that nobody was waiting for: auto reports, answers that came too late.
    pub reports: u64,
    /// Lines of text.
    pub lines: u64,
}

/// A host's conversation with one recorder.
pub struct Conversation {
    session: Session,
    job: Job,
    cursor: Option<Cursor>,
    position: Option<LogPosition>,
    size: u16,
    may_keep_up: bool,
    account: Account,
    /// The settings in force by the latest answer, until somebody takes them.
    in_force: Option<Configuration>,
    /// Requests in a row that were not answered.
    failures: u32,
    /// When the latest order was given.
    began_ms: u64,
    /// Whether the latest reading came to the end of the log.
    at_end: bool,
    /// Whether a report has shown that there is something to read.
    behind: bool,
    talk: Talk,
}

/// A message to be sent.
pub struct Outgoing {
    /// For a bus.
    pub command: Command,
    /// For a line.
    pub frame: Vec<u8>,
}

impl Conversation {
    /// A host that has never talked to the recorder.
    #[must_use]
    pub fn new(name: &'static str, line_rate: LineRate) -> Conversation {
        let timing = Timing { timeout: Duration::from_secs(1), retries: 2, line_rate };
        Conversation {
            session: Session::new(timing),
            job: Job::Rest,
            cursor: None,
            position: None,
            size: 2048,
            may_keep_up: false,
            account: Account::new(name),
            in_force: None,
            failures: 0,
            began_ms: 0,
            at_end: false,
            behind: false,
            talk: Talk::default(),
        }
    }

    /// The same conversation with one request at a time, as the client has it on a bus.
    #[must_use]
    pub fn one_at_a_time(self) -> Conversation {
        Conversation { session: self.session.one_at_a_time(), ..self }
    }

    /// Lets every other reading from now on continue as long as there is enough for a full reply,
    /// which may be for ever.
    pub fn keep_up(&mut self) {
        self.may_keep_up = true;
    }

    /// The session, to tell it about changes of the line.
    pub fn session(&mut self) -> &mut Session {
        &mut self.session
    }

    /// What the reader was told.
    #[must_use]
    pub fn account(&self) -> &Account {
        &self.account
    }

    /// What the reader was told, mutably.
    pub fn account_mut(&mut self) -> &mut Account {
        &mut self.account
    }

    /// What was counted.
    #[must_use]
    pub fn talk(&self) -> Talk {
        self.talk
    }

    /// Whether nothing is under way.
    #[must_use]
    pub fn is_resting(&self) -> bool {
        matches!(self.job, Job::Rest)
    }

    /// Requests in a row that were not answered.
    #[must_use]
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Whether there is something that a report could not bring.
    #[must_use]
    pub fn is_behind(&self) -> bool {
        self.behind
    }

    /// The settings in force, if an answer has told them since this was last asked.
    pub fn take_in_force(&mut self) -> Option<Configuration> {
        self.in_force.take()
    }

    /// Whether the latest order was a reading that began at this time or later and reached the end
    /// of the log.
    #[must_use]
    pub fn has_read_since(&self, ms: u64) -> bool {
        self.at_end && self.began_ms >= ms
    }

    /// Where the host is, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        let job = match &self.job {
            Job::Rest => "resting",
            Job::Read { .. } => "reading",
            Job::LearnSize { .. } => "asking for the size",
            Job::Ask => "asking",
            Job::SetClock(_) => "setting the clock",
        };
        let Conversation { account, failures, size, cursor, talk, .. } = self;
        let (name, cursor) = (account.name(), cursor.map(|cursor| cursor.total()));
        format!(
            "{name} ({job}; {failures} failures, size {size}, total at cursor {cursor:?}, {talk:?})"
        )
    }

    /// Begins an order. The host must be resting.
    pub fn begin(&mut self, order: Order, now_ms: u64) {
        self.at_end = false;
        self.began_ms = now_ms;
        match order {
            Order::Read => {
                self.behind = false;
                // The size is asked for again, because another host may have changed it, and a
                // reading is only as good as the size that it assumes.
                self.job = Job::LearnSize { resyncs: 0 };
                self.request(Command::QueryConfiguration, now_ms);
            }
            Order::Ask(command) => {
                self.job = Job::Ask;
                self.request(command, now_ms);
            }
            Order::SetClock(time) => {
                self.job = Job::SetClock(time);
                self.session.cancel(duration(now_ms));
                let _ = self.session.request_set_clock();
            }
        }
    }

    /// Forgets what is under way, like a program that is ended.
    pub fn give_up(&mut self, now_ms: u64) {
        self.session.cancel(duration(now_ms));
        self.job = Job::Rest;
    }

    fn request(&mut self, command: Command, now_ms: u64) {
        self.session.cancel(duration(now_ms));
        // No other request is under way now, so there is room.
        let _ = self.session.request(command);
    }

    fn begin_reading(&mut self, resyncs: u32, now_ms: u64) {
        self.account.begin_reading();
        let keeps_up = self.may_keep_up && self.talk.readings % 2 == 1;
        let mut reader = LogReader::new(self.cursor, self.size).keeping_up(keeps_up);
        if let Some(position) = self.position.take() {
            reader = reader.starting_near(position);
        }
        self.session.cancel(duration(now_ms));
        self.go_on_reading(Box::new(reader), resyncs);
    }

    /// Asks for as much as may be under way at once.
    fn go_on_reading(&mut self, mut reader: Box<LogReader>, resyncs: u32) {
        while self.session.has_room()
            && let Some(request) = reader.request()
        {
            // There is room.
            let _ = self.session.request(request.into());
        }
        if reader.is_waiting() {
            self.job = Job::Read { reader, resyncs };
        } else {
            self.position = Some(reader.summary().position);
            self.at_end = true;
            self.talk.readings += 1;
            self.job = Job::Rest;
        }
    }

    /// When there is something to do, if nothing arrives before.
    #[must_use]
    pub fn wake_ms(&self) -> Option<u64> {
        let at = self.session.poll_at()?;
        Some(u64::try_from(at.as_nanos().div_ceil(1_000_000)).unwrap_or(u64::MAX))
    }

    /// Does what is due, and returns what is to be sent.
    ///
    /// # Errors
    /// When the recorder's log is not what it must be.
    pub fn poll(&mut self, now_ms: u64, ledger: &Ledger) -> Result<Option<Outgoing>, String> {
        self.take_unsolicited();
        loop {
            if let Some(outgoing) = self.dispatch(now_ms) {
                return Ok(Some(outgoing));
            }
            // The session may just have given the request up.
            match self.session.take_answer() {
                None => return Ok(None),
                Some(Ok(reply)) => {
                    self.failures = 0;
                    self.talk.answered += 1;
                    self.answered(&reply, now_ms, ledger)?;
                }
                Some(Err(_)) => self.unanswered(now_ms),
            }
        }
    }

    fn unanswered(&mut self, now_ms: u64) {
        self.failures += 1;
        self.talk.unanswered += 1;
        match self.job {
            // An original recorder does not know the question. The size stays what it was.
            Job::LearnSize { resyncs } if resyncs > 0 => self.begin_reading(resyncs, now_ms),
            _ => self.job = Job::Rest,
        }
    }

    fn dispatch(&mut self, now_ms: u64) -> Option<Outgoing> {
        let Job::SetClock(time) = self.job else {
            let attempt = self.session.dispatch(duration(now_ms))?;
            return Some(Outgoing { command: *attempt.command(), frame: attempt.frame().to_vec() });
        };
        let mut attempt = self.session.dispatch(duration(now_ms))?;
        // Each attempt has a time of its own, which shows which attempt it was.
        let millisecond = (u32::from(time.millisecond) + attempt.number()) % 1000;
        attempt
            .set_time(TimeStamp { millisecond: u16::try_from(millisecond).unwrap_or(0), ..time });
        Some(Outgoing { command: *attempt.command(), frame: attempt.frame().to_vec() })
    }

    fn answered(&mut self, reply: &Reply, now_ms: u64, ledger: &Ledger) -> Result<(), String> {
        if let Reply::Configuration(configuration) = reply {
            self.size = configuration.size;
            self.in_force = Some(*configuration);
        }
        match (std::mem::replace(&mut self.job, Job::Rest), reply) {
            (Job::Read { reader, resyncs }, Reply::Read(reply)) => {
                self.take_read(reader, resyncs, reply, now_ms, ledger)?;
            }
            (Job::LearnSize { resyncs }, _) => self.begin_reading(resyncs, now_ms),
            _ => {}
        }
        Ok(())
    }

    fn take_read(
        &mut self,
        mut reader: Box<LogReader>,
        resyncs: u32,
        reply: &ReadReply,
        now_ms: u64,
        ledger: &Ledger,
    ) -> Result<(), String> {
        self.account.see_total(reply.total);
        let mut deliveries = Vec::new();
        let taken = reader.take(reply, &mut |delivery| deliveries.push(delivery));
        self.deliver(&deliveries, ledger)?;
        self.cursor = reader.cursor();
        match taken {
            Ok(()) => self.go_on_reading(reader, resyncs),
            Err(Disturbed::Changed | Disturbed::WrongSize) if resyncs < MAX_RESYNCS => {
                self.talk.disturbed += 1;
                self.job = Job::LearnSize { resyncs: resyncs + 1 };
                self.request(Command::QueryConfiguration, now_ms);
            }
            Err(_) => self.talk.disturbed += 1,
        }
        Ok(())
    }

    fn deliver(&mut self, deliveries: &[Delivery], ledger: &Ledger) -> Result<(), String> {
        self.account.set_known(match self.cursor {
            None => Known::Nothing,
            Some(Cursor { anchor: None, .. }) => Known::EmptyLog,
            Some(Cursor { anchor: Some(_), .. }) => Known::Event,
        });
        deliveries.iter().try_for_each(|delivery| self.account.take(delivery, ledger))
    }

    fn take_unsolicited(&mut self) {
        while let Some(message) = self.session.take_unsolicited() {
            match message {
                Unsolicited::Line(_) => self.talk.lines += 1,
                Unsolicited::Report(_) => {
                    self.talk.reports += 1;
                    // A reading that is under way gets to these events anyway.
                    self.behind |= !matches!(self.job, Job::Read { .. });
                }
            }
        }
    }
}

/// A moment in the time of the session.
#[must_use]
pub fn duration(now_ms: u64) -> Duration {
    Duration::from_millis(now_ms)
}
