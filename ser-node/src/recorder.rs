//! What the recorder knows and does, whichever port asks: log, clock, configuration, recording mode.

use chrono::NaiveDateTime;
use ser_proto::{
    Code, Command, Configuration, Configure, Entry, Inputs, LastBroadcast, MAX_ENTRIES, Mode, Model,
    ParseError, ReadReply, Reply, TimeStamp,
};

use crate::clock::{Clock, Rtc, to_time_stamp};
use crate::diagnostics::{Diagnostics, count};
use crate::event_log::{Event, EventLog};
use crate::node::VERSION;
use crate::sequencer::Change;
use crate::settings::{Settings, Storage};

/// What a command is answered with. The content is looked up when the reply goes out, so that it is true then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) enum Answer {
    Configuration,
    Erased,
    LastBroadcast,
    Mode,
    PrintAccepted,
    Read { start: u16, count: u8 },
    ClockSet,
}

/// The part of the node that all ports share.
pub(crate) struct Recorder<'a, S, R> {
    pub(crate) model: Model,
    pub(crate) log: EventLog<'a>,
    pub(crate) configuration: Configuration,
    pub(crate) diagnostics: Diagnostics,
    clock: Clock,
    recording: Recording,
    last_broadcast: Option<LastBroadcast>,
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
            recording: Recording::ON,
            last_broadcast: None,
            settings,
            rtc,
        }
    }

    /// Puts a change into the log, if recording was on when it happened.
    pub(crate) fn record(&mut self, change: Change) {
        if self.recording.at(change.tick_ms) {
            let time_ms = self.clock.at(change.tick_ms);
            self.log.append(Event { time_ms, changed: change.changed, state: change.state });
        }
    }

    /// Carries out a command that arrived at `tick_ms`.
    pub(crate) fn execute(&mut self, command: &Command, tick_ms: u64) -> Answer {
        match *command {
            Command::QueryConfiguration => Answer::Configuration,
            Command::Configure(configure) => self.configure(&configure),
            Command::Erase => {
                self.log.erase();
                Answer::Erased
            }
            Command::LastBroadcast => Answer::LastBroadcast,
            Command::QueryMode => Answer::Mode,
            Command::SetMode { recording } => {
                self.recording.switch(recording, tick_ms);
                Answer::Mode
            }
            Command::Print { .. } => Answer::PrintAccepted,
            Command::Read { start, count } => Answer::Read { start, count },
            Command::SetClock(time) => self.set_clock(time, tick_ms),
        }
    }

    /// Counts a body that is no command; some are answered all the same, with what is in force.
    pub(crate) fn refuse(&mut self, error: ParseError) -> Option<Answer> {
        self.diagnostics.count_parse_error(error);
        match error {
            ParseError::BadValue { code, .. } => match Code::from_byte(code)? {
                Code::Configure => Some(Answer::Configuration),
                Code::Mode => Some(Answer::Mode),
                _ => None,
            },
            _ => None,
        }
    }

    /// The reply that goes with an answer, with at most `max_entries` entries.
    pub(crate) fn reply(&self, answer: Answer, max_entries: usize) -> Reply {
        match answer {
            Answer::Configuration => Reply::Configuration(self.configuration),
            Answer::Erased => Reply::Erased,
            Answer::LastBroadcast => Reply::LastBroadcast(self.last_broadcast),
            Answer::Mode => Reply::Mode(Mode { recording: self.recording.now, version: VERSION }),
            Answer::PrintAccepted => Reply::PrintAccepted,
            Answer::Read { start, count } => {
                Reply::Read(self.read(start, usize::from(count).min(max_entries)))
            }
            Answer::ClockSet => Reply::ClockSet,
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

    fn entry(&self, event: &Event) -> Entry {
        Entry {
            changed: Inputs(event.changed),
            state: Inputs(event.state),
            time: to_time_stamp(event.time_ms),
        }
    }

    fn configure(&mut self, configure: &Configure) -> Answer {
        if configure.size.is_some_and(|size| size > self.log.capacity()) {
            count(&mut self.diagnostics.parameters_refused, 1);
            return Answer::Configuration;
        }
        let configuration = configure.apply_to(&self.configuration);
        if configuration != self.configuration {
            self.log.resize(configuration.size);
            self.configuration = configuration;
            if self.settings.save(&configuration).is_err() {
                count(&mut self.diagnostics.storage_errors, 1);
            }
        }
        Answer::Configuration
    }

    fn set_clock(&mut self, time: TimeStamp, tick_ms: u64) -> Answer {
        // The parser let no impossible date through.
        if let Ok(time) = NaiveDateTime::try_from(time) {
            self.clock.set(tick_ms, time);
            self.rtc.write(time);
        }
        Answer::ClockSet
    }
}

/// Whether events are recorded, and since when.
///
/// Debounce brings changes up to 255 ms after they happened; the mode of that moment decides about them.
#[derive(Clone, Copy, Debug)]
struct Recording {
    now: bool,
    before: bool,
    since_ms: u64,
}

impl Recording {
    /// As after power-up.
    const ON: Recording = Recording { now: true, before: true, since_ms: 0 };

    fn switch(&mut self, on: bool, tick_ms: u64) {
        if on != self.now {
            *self = Recording { now: on, before: self.now, since_ms: tick_ms };
        }
    }

    /// The state of the inputs at the switch belongs to the time before it: it is the baseline.
    fn at(&self, tick_ms: u64) -> bool {
        if tick_ms > self.since_ms { self.now } else { self.before }
    }
}
