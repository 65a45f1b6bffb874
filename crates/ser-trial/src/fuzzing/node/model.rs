//! A recorder that has only what the manual and `docs/protocol.md` say: plain vectors, no queue,
//! and no limit of time.

use std::collections::BTreeMap;

use chrono::{DateTime, NaiveDateTime};
use ser_node::VERSION;
use ser_proto::{
    AutoReport, Command, Configuration, Configure, Entry, Inputs, LastBroadcast, Mode, Model,
    ParseError, ReadReply, Reply, TimeStamp,
};

use crate::served::command_in;

/// A hundred years, 1970–2069: what two-digit years can tell apart.
const CENTURY_MS: i64 = 36_525 * 24 * 60 * 60 * 1000;

/// What the recorder says on its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Said {
    Reply(Reply),
    Line(String),
    /// An event that auto report owes to a device on the Genius bus.
    Owed(Entry),
}

/// Counts of bad input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Refused {
    /// Datagrams without a command byte. Frames without one never get this far.
    pub(super) empty: u32,
    pub(super) unknown: u32,
    pub(super) wrong_length: u32,
    pub(super) parameters: u32,
}

/// A value over time.
#[derive(Clone, Debug)]
struct History<T>(Vec<(u64, T)>);

impl<T: Copy> History<T> {
    /// The value that was in force when the sample of `tick_ms` was taken. The sample comes before
    /// everything else in its millisecond.
    fn at_sample(&self, tick_ms: u64) -> T {
        let earlier = self.0.iter().rev().find(|(since_ms, _)| *since_ms < tick_ms);
        earlier.unwrap_or(&self.0[0]).1
    }

    fn latest(&self) -> T {
        self.0[self.0.len() - 1].1
    }
}

/// The model recorder, under power.
#[derive(Clone, Debug)]
pub(super) struct Recorder {
    pub(super) model: Model,
    /// Debounce time of each input, and the longest of them.
    debounce_ms: [u64; 32],
    hold_ms: u64,
    pub(super) configuration: Configuration,
    /// What the battery-backed clock shows at power-up.
    rtc: NaiveDateTime,
    pub(super) refused: Refused,
    pub(super) last_broadcast: Option<LastBroadcast>,

    /// The entries in their slots. Entries that do not exist yet are not in it.
    slots: Vec<Entry>,
    next_slot: usize,
    total: u16,
    /// Calendar time at tick 0.
    offset_ms: History<i64>,
    recording: History<bool>,
    /// Inputs after debounce: as accepted, and as recorded.
    accepted: u32,
    recorded: u32,
    /// Since when an input differs from its accepted state.
    differs_since: [Option<u64>; 32],
    /// Accepted changes by the tick at which they began, until no earlier one can turn up.
    held_back: BTreeMap<u64, u32>,
}

impl Recorder {
    /// A recorder as delivered, switched on at tick 0.
    pub(super) fn new(model: Model, debounce_ms: [u8; 32], rtc: NaiveDateTime) -> Recorder {
        let debounce_ms = debounce_ms.map(u64::from);
        let mut recorder = Recorder {
            model,
            debounce_ms,
            hold_ms: debounce_ms.into_iter().max().unwrap_or(0),
            configuration: Configuration::default(),
            rtc,
            refused: Refused::default(),
            last_broadcast: None,
            slots: Vec::new(),
            next_slot: 0,
            total: 0,
            offset_ms: History(Vec::new()),
            recording: History(Vec::new()),
            accepted: 0,
            recorded: 0,
            differs_since: [None; 32],
            held_back: BTreeMap::new(),
        };
        recorder.power_cycle(0);
        recorder
    }

    /// Loses everything except configuration and clock. The inputs as they are now are the
    /// baseline.
    pub(super) fn power_cycle(&mut self, inputs: u32) {
        self.refused = Refused::default();
        self.last_broadcast = None;
        self.erase();
        self.offset_ms = History(vec![(0, self.rtc.and_utc().timestamp_millis())]);
        self.recording = History(vec![(0, true)]);
        (self.accepted, self.recorded) = (inputs, inputs);
        self.differs_since = [None; 32];
        self.held_back.clear();
    }

    /// Entries in use.
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Takes the state of the inputs in millisecond `tick_ms`. Returns what is said because of it.
    pub(super) fn sample(&mut self, tick_ms: u64, inputs: u32) -> Vec<Said> {
        for index in 0..32 {
            let bit = 1 << index;
            if (inputs ^ self.accepted) & bit == 0 {
                self.differs_since[index] = None;
                continue;
            }
            let began_ms = *self.differs_since[index].get_or_insert(tick_ms);
            if tick_ms - began_ms == self.debounce_ms[index] {
                self.differs_since[index] = None;
                self.accepted ^= bit;
                *self.held_back.entry(began_ms).or_default() |= bit & self.model.mask();
            }
        }
        let mut said = Vec::new();
        while let Some(first) =
            self.held_back.first_entry().filter(|first| first.key() + self.hold_ms <= tick_ms)
        {
            let (began_ms, changed) = first.remove_entry();
            if changed != 0 {
                said.extend(self.record(began_ms, changed));
            }
        }
        said
    }

    fn record(&mut self, tick_ms: u64, changed: u32) -> Vec<Said> {
        self.recorded ^= changed;
        if !self.recording.at_sample(tick_ms) {
            return Vec::new();
        }
        let time_ms = within_century(self.offset_ms.at_sample(tick_ms), tick_ms);
        let state = Inputs(self.recorded & self.model.mask());
        let slot = self.next_slot;
        let entry = Entry { changed: Inputs(changed), state, time: to_time_stamp(time_ms) };
        self.append(entry);
        let mut said = Vec::new();
        match self.configuration.auto_report {
            AutoReport::Rs232 => said.push(Said::Reply(self.read(slot + 1, 1))),
            AutoReport::Genius => said.push(Said::Owed(entry)),
            AutoReport::Off => {}
        }
        if self.configuration.auto_print {
            said.push(self.line(slot));
        }
        said
    }

    /// Takes the body of a good frame, or of a datagram, in millisecond `tick_ms`. Returns what is
    /// said because of it, with at most `max_entries` entries in a reply.
    pub(super) fn body(&mut self, body: &[u8], tick_ms: u64, max_entries: u8) -> Vec<Said> {
        match command_in(body) {
            Ok(command) => self.command(&command, tick_ms, max_entries),
            Err(error) => self.refuse(error),
        }
    }

    /// Takes the body of a datagram to everybody, which is not answered. Returns the command, if
    /// there is one.
    pub(super) fn broadcast(&mut self, body: &[u8], tick_ms: u64) -> Option<Command> {
        match command_in(body) {
            Ok(command) => {
                // A command that only asks one recorder for something has no effect.
                if matches!(
                    command,
                    Command::Configure(_)
                        | Command::Erase
                        | Command::SetMode { .. }
                        | Command::SetClock(_)
                ) {
                    self.command(&command, tick_ms, 0);
                }
                Some(command)
            }
            Err(error) => {
                self.refuse(error);
                None
            }
        }
    }

    /// The time now, in milliseconds since 1970.
    pub(super) fn now_ms(&self, tick_ms: u64) -> i64 {
        within_century(self.offset_ms.latest(), tick_ms)
    }

    /// Sets the battery-backed clock to the time of this millisecond.
    pub(super) fn set_battery_clock(&mut self, tick_ms: u64) {
        self.rtc = DateTime::from_timestamp_millis(self.now_ms(tick_ms))
            .expect("within the century")
            .naive_utc();
    }

    /// Whether an entry is no longer in the ring.
    pub(super) fn has_lost(&self, entry: &Entry) -> bool {
        !self.slots.contains(entry)
    }

    fn refuse(&mut self, error: ParseError) -> Vec<Said> {
        match error {
            ParseError::UnknownCode { .. } => self.refused.unknown += 1,
            ParseError::WrongLength { .. } => self.refused.wrong_length += 1,
            ParseError::BadValue { .. } => self.refused.parameters += 1,
            ParseError::Empty => self.refused.empty += 1,
            ParseError::TooShort { .. } | ParseError::EntrySize { .. } => {
                panic!("{error} in a command")
            }
        }
        match error {
            ParseError::BadValue { code: b'C', .. } => vec![self.settings()],
            ParseError::BadValue { code: b'M', .. } => vec![self.mode()],
            _ => Vec::new(),
        }
    }

    fn command(&mut self, command: &Command, tick_ms: u64, max_entries: u8) -> Vec<Said> {
        match *command {
            Command::QueryConfiguration => vec![self.settings()],
            Command::Configure(configure) => {
                self.configure(&configure);
                vec![self.settings()]
            }
            Command::Erase => {
                self.erase();
                vec![Said::Reply(Reply::Erased)]
            }
            Command::LastBroadcast => vec![Said::Reply(Reply::LastBroadcast(self.last_broadcast))],
            Command::QueryMode => vec![self.mode()],
            Command::SetMode { recording } => {
                self.recording.0.push((tick_ms, recording));
                vec![self.mode()]
            }
            Command::Print { start, count } => {
                self.refuse_start(start);
                let (start, count) = (usize::from(start), usize::from(count));
                let slots = (start.wrapping_sub(1)..self.slots.len()).take(count);
                let accepted = Said::Reply(Reply::PrintAccepted);
                [accepted].into_iter().chain(slots.map(|slot| self.line(slot))).collect()
            }
            Command::Read { start, count } => {
                if !self.refuse_start(start) {
                    self.refused.parameters += u32::from(count > max_entries);
                }
                vec![Said::Reply(self.read(start.into(), count.min(max_entries).into()))]
            }
            Command::SetClock(time) => {
                self.rtc = NaiveDateTime::try_from(time).expect("a date that was parsed");
                let now_ms = self.rtc.and_utc().timestamp_millis();
                self.offset_ms.0.push((tick_ms, now_ms - tick_ms.cast_signed()));
                vec![Said::Reply(Reply::ClockSet)]
            }
            Command::Identify
            | Command::Time { .. }
            | Command::QueryFilters { .. }
            | Command::SetFilter { .. }
            | Command::Diagnostics { .. } => panic!("{command:?} is unknown to a recorder"),
        }
    }

    fn refuse_start(&mut self, start: u16) -> bool {
        let refused = start == 0 || start > self.configuration.size;
        self.refused.parameters += u32::from(refused);
        refused
    }

    fn settings(&self) -> Said {
        Said::Reply(Reply::Configuration(self.configuration))
    }

    fn mode(&self) -> Said {
        Said::Reply(Reply::Mode(Mode { recording: self.recording.latest(), version: VERSION }))
    }

    fn append(&mut self, entry: Entry) {
        if self.next_slot == self.slots.len() {
            self.slots.push(entry);
        } else {
            self.slots[self.next_slot] = entry;
        }
        self.next_slot = (self.next_slot + 1) % usize::from(self.configuration.size);
        self.total = self.total.wrapping_add(1);
    }

    fn erase(&mut self) {
        self.slots.clear();
        self.next_slot = 0;
        self.total = 0;
    }

    fn configure(&mut self, configure: &Configure) {
        let before = self.configuration;
        self.configuration = configure.apply_to(&before);
        if before.size == self.configuration.size {
            return;
        }
        // The newest entries that fit are kept in order, from slot 0.
        if self.slots.len() == usize::from(before.size) {
            self.slots.rotate_left(self.next_slot);
        }
        let size = usize::from(self.configuration.size);
        self.slots.drain(..self.slots.len().saturating_sub(size));
        self.next_slot = self.slots.len() % size;
    }

    /// The existing entries from number `start` on, at most `count`.
    fn read(&self, start: usize, count: usize) -> Reply {
        let existing =
            start.checked_sub(1).and_then(|slot| self.slots.get(slot..)).unwrap_or_default();
        let entries = existing.iter().copied().take(count).collect::<Vec<_>>();
        Reply::Read(ReadReply {
            start: u16::try_from(start).expect("a number of two bytes"),
            total: self.total,
            next_slot: u16::try_from(self.next_slot).expect("below the size"),
            model: (!entries.is_empty()).then_some(self.model),
            entries: entries.into_iter().collect(),
        })
    }

    fn line(&self, slot: usize) -> Said {
        let Entry { changed, state, time } = self.slots[slot];
        let date_and_time = time.to_string().replace('T', " ");
        let mut line = format!("{:04} {date_and_time}", slot + 1);
        for number in (1..=32).filter(|&number| changed.contains(number)) {
            line += &format!("  {number} {}", if state.contains(number) { "ON" } else { "OFF" });
        }
        Said::Line(line)
    }
}

fn within_century(offset_ms: i64, tick_ms: u64) -> i64 {
    (offset_ms + tick_ms.cast_signed()).rem_euclid(CENTURY_MS)
}

fn to_time_stamp(time_ms: i64) -> TimeStamp {
    let time = DateTime::from_timestamp_millis(time_ms).expect("within the century").naive_utc();
    TimeStamp::try_from(time).expect("within the century")
}
