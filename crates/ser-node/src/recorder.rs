//! What the recorder knows and does, whichever port asks: log, clock, configuration, recording
//! mode.

use chrono::NaiveDateTime;
use ser_proto::{
    Code, Command, Configuration, Configure, Entry, Inputs, LastBroadcast, MAX_ENTRIES, Mode,
    Model, ParseError, ReadReply, Reply, TimeStamp,
};

use crate::calendar::date_time;
use crate::clock::{Clock, Rtc, to_time_stamp};
use crate::diagnostics::{Diagnostics, count};
use crate::event_log::{Event, EventLog};
use crate::history::History;
use crate::node::VERSION;
use crate::sequencer::Change;
use crate::settings::{Settings, Storage};

/// A command that has arrived and whose reply waits for its turn.
///
/// Where the moment of arrival matters, the command has been carried out; all others are carried
/// out when their turn comes, so that a read is never answered from a log that a later command has
/// erased already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Answer {
    /// Still to be carried out.
    To(Command),
    /// The clock was set on arrival.
    ClockSet,
    /// The mode was set, or asked for, on arrival.
    Mode { recording: bool },
}

/// The part of the node that all ports share.
pub(crate) struct Recorder<'a, S, R> {
    pub(crate) model: Model,
    pub(crate) log: EventLog<'a>,
    pub(crate) configuration: Configuration,
    pub(crate) diagnostics: Diagnostics,
    clock: Clock,
    recording: History<bool>,
    last_broadcast: Option<LastBroadcast>,
    /// Sequence number of the next event to report, whichever port reports.
    report_next: u64,
    settings: Settings<S>,
    rtc: R,
}

impl<'a, S: Storage, R: Rtc> Recorder<'a, S, R> {
    pub(crate) fn new(
        model: Model,
        log: &'a mut [Event],
        storage: S,
        mut rtc: R,
        now_ms: u64,
    ) -> Recorder<'a, S, R> {
        let (settings, mut configuration) = Settings::load(storage);
        let mut log = EventLog::new(log);
        log.resize(configuration.size);
        configuration.size = log.size();
        let clock = Clock::new(now_ms, rtc.read());
        Recorder {
            model,
            log,
            configuration,
            diagnostics: Diagnostics::default(),
            clock,
            recording: History::new(true),
            last_broadcast: None,
            report_next: 0,
            settings,
            rtc,
        }
    }

    /// Whether changes are recorded now.
    pub(crate) fn is_recording(&self) -> bool {
        self.recording.latest()
    }

    /// Puts a change into the log, if recording was on when it happened.
    pub(crate) fn record(&mut self, change: Change) {
        if self.recording.at_sample(change.tick_ms) {
            let time_ms = self.clock.stamp_ms(change.tick_ms);
            self.log.append(Event { time_ms, changed: change.changed, state: change.state });
        }
    }

    /// Takes a command that arrived at `tick_ms`, which may be a while before `now_ms`, and carries
    /// it out if that moment matters.
    pub(crate) fn arrived(&mut self, command: &Command, tick_ms: u64, now_ms: u64) -> Answer {
        match *command {
            Command::SetClock(time) => {
                self.set_clock(time, tick_ms, now_ms);
                Answer::ClockSet
            }
            Command::SetMode { recording } => {
                self.recording.set(tick_ms, recording);
                self.mode()
            }
            Command::QueryMode => self.mode(),
            other => Answer::To(other),
        }
    }

    /// Counts a body that is no command; some are answered all the same, with what is in force.
    pub(crate) fn refuse(&mut self, error: ParseError) -> Option<Answer> {
        self.diagnostics.count_parse_error(error);
        match error {
            ParseError::BadValue { code, .. } => match Code::from_byte(code)? {
                Code::Configure => Some(Answer::To(Command::QueryConfiguration)),
                Code::Mode => Some(self.mode()),
                _ => None,
            },
            _ => None,
        }
    }

    /// Carries out what is still to be done, and gives the reply, with at most `max_entries`
    /// entries.
    pub(crate) fn reply(&mut self, answer: Answer, max_entries: usize) -> Reply {
        match answer {
            Answer::ClockSet => Reply::ClockSet,
            Answer::Mode { recording } => Reply::Mode(Mode { recording, version: VERSION }),
            Answer::To(command) => match command {
                Command::Configure(configure) => self.configure(&configure),
                Command::Erase => self.erase(),
                Command::Print { start, .. } => {
                    self.count_refused(start == 0 || start > self.log.size());
                    Reply::PrintAccepted
                }
                Command::Read { start, count } => {
                    let count = usize::from(count);
                    self.count_refused(
                        start == 0 || start > self.log.size() || count > max_entries,
                    );
                    Reply::Read(self.read(start, count.min(max_entries)))
                }
                Command::LastBroadcast => Reply::LastBroadcast(self.last_broadcast),
                Command::QueryConfiguration
                | Command::QueryMode
                | Command::SetMode { .. }
                | Command::SetClock(_) => Reply::Configuration(self.configuration),
            },
        }
    }

    /// The entries from `start` on that exist, at most `count` and not around the end of the ring.
    pub(crate) fn read(&self, start: u16, count: usize) -> ReadReply {
        let entries = (start..=self.log.len())
            .map_while(|number| self.log.entry(number))
            .take(count.min(MAX_ENTRIES))
            .map(|event| self.entry(event))
            .collect::<heapless::Vec<_, MAX_ENTRIES>>();
        ReadReply {
            start,
            total: self.log.total(),
            next_slot: self.log.next_slot(),
            model: (!entries.is_empty()).then_some(self.model),
            entries,
        }
    }

    /// The oldest events that auto report owes to its receiver, and the sequence number of the
    /// first one.
    ///
    /// They stay owed until [`reported`](Self::reported); those that the ring has overwritten
    /// meanwhile are counted.
    pub(crate) fn report(&mut self, max_entries: usize) -> Option<(u64, ReadReply)> {
        let overwritten = self.log.oldest_sequence().saturating_sub(self.report_next);
        self.report_next += overwritten;
        count(&mut self.diagnostics.events_unreported, overwritten);
        let start = self.log.entry_number(self.report_next)?;
        // In a ring that has wrapped, the slots behind the newest event hold the oldest ones.
        let owed =
            usize::try_from(self.log.next_sequence() - self.report_next).unwrap_or(usize::MAX);
        Some((self.report_next, self.read(start, owed.min(max_entries))))
    }

    /// So many events from `first` on have reached their receiver. Means nothing when others are
    /// owed by now.
    pub(crate) fn reported(&mut self, first: u64, entries: usize) {
        if self.report_next == first {
            self.report_next += entries as u64;
        }
    }

    /// A command came by broadcast and has been carried out.
    ///
    /// The time is that of reception by the clock as it is now: after a broadcast that set it, the
    /// time that was set.
    pub(crate) fn broadcast_received(&mut self, code: Code, tick_ms: u64) {
        let time = to_time_stamp(self.clock.now_ms(tick_ms));
        self.last_broadcast = Some(LastBroadcast {
            code: code.byte(),
            hour: time.hour,
            minute: time.minute,
            second: time.second,
            millisecond: time.millisecond,
        });
    }

    fn entry(&self, event: &Event) -> Entry {
        Entry {
            changed: Inputs(event.changed),
            state: Inputs(event.state),
            time: to_time_stamp(event.time_ms),
        }
    }

    fn configure(&mut self, configure: &Configure) -> Reply {
        if configure.size.is_some_and(|size| size > self.log.capacity()) {
            self.count_refused(true);
            return Reply::Configuration(self.configuration);
        }
        let configuration = configure.apply_to(&self.configuration);
        self.log.resize(configuration.size);
        if configuration.auto_report != self.configuration.auto_report {
            // It begins with the next event when it is switched on, or over to the other port.
            self.report_next = self.log.next_sequence();
        }
        self.configuration = configuration;
        // Also when nothing changes: it may be in force and not stored, because storing failed.
        if !self.settings.holds(&configuration) && self.settings.save(&configuration).is_err() {
            count(&mut self.diagnostics.storage_errors, 1);
        }
        Reply::Configuration(configuration)
    }

    fn erase(&mut self) -> Reply {
        self.log.erase();
        // Erased events are not owed to anybody.
        self.report_next = self.log.next_sequence();
        Reply::Erased
    }

    fn mode(&self) -> Answer {
        Answer::Mode { recording: self.recording.latest() }
    }

    fn count_refused(&mut self, refused: bool) {
        count(&mut self.diagnostics.parameters_refused, u64::from(refused));
    }

    fn set_clock(&mut self, time: TimeStamp, tick_ms: u64, now_ms: u64) {
        // The parser let no impossible date through.
        if let Ok(time) = NaiveDateTime::try_from(time) {
            self.clock.set(tick_ms, time);
            // The battery-backed clock starts from what it is given when it is given it.
            self.rtc.write(date_time(self.clock.now_ms(now_ms)).unwrap_or(time));
        }
    }
}
