//! A recorder that has only what the manual and `docs/protocol.md` say: plain vectors, no queue,
//! and no limit of time.

use std::collections::BTreeMap;
use std::num::NonZeroU8;

use chrono::{DateTime, NaiveDateTime};
use ser_node::VERSION;
use ser_proto::{
    AutoReport, Capabilities, ChatterFilter, ClockReading, ClockSource, Command, Configuration,
    Configure, Counter, Entry, Filters, FirmwareVersion, Guard, Identity, InputFilter, Inputs,
    LastBroadcast, Mark, Mode, Model, ParseError, ReadReply, Reply, TimeStamp,
};

/// A hundred years, 1970–2069: what two-digit years can tell apart.
const CENTURY_MS: i64 = 36_525 * 24 * 60 * 60 * 1000;

/// What the recorder says on its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Said {
    Reply(Reply),
    Line(String),
    /// An event that auto report owes to a device on the Genius bus.
    Owed(Entry),
    /// A page of the counters, from this one on.
    Counters(Counter),
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
    /// Debounce time of each input by the board, and as it is in force.
    strapped_ms: [u8; 32],
    debounce_ms: [u8; 32],
    /// The filters that a host has set.
    filters: Option<[InputFilter; 32]>,
    power_ups: u32,
    life: u32,
    pub(super) configuration: Configuration,
    /// What the battery-backed clock shows at power-up.
    rtc: NaiveDateTime,
    pub(super) refused: Refused,
    pub(super) last_broadcast: Option<LastBroadcast>,

    /// The entries in their slots. Entries that do not exist yet are not in it.
    slots: Vec<Entry>,
    next_slot: usize,
    total: u64,
    /// Calendar time at tick 0.
    offset_ms: History<i64>,
    pub(super) source: ClockSource,
    set_ms: u64,
    mark: Option<Mark>,
    recording: History<bool>,
    /// Inputs after debounce: as accepted, and as recorded.
    accepted: u32,
    recorded: u32,
    /// Since when an input differs from its accepted state.
    differs_since: [Option<u64>; 32],
    /// Accepted changes by the tick at which they began, until no earlier one can turn up.
    held_back: BTreeMap<u64, u32>,
    chatter: [Chatter; 32],
    /// All changes up to this tick have been through the filters.
    settled_ms: u64,
}

/// The chatter filter of one input.
#[derive(Clone, Copy, Debug, Default)]
struct Chatter {
    chatters: bool,
    window_began_ms: Option<u64>,
    changes: u8,
    changed_ms: u64,
    /// Whether the input is on, and what the log shows.
    on: bool,
    recorded: bool,
    /// Changes that were left out.
    suppressed: u32,
}

impl Chatter {
    /// Whether the log shows a change in this millisecond.
    fn pass(&mut self, filter: Option<ChatterFilter>, tick_ms: u64, changes: bool) -> bool {
        self.on ^= changes;
        match filter {
            None => self.chatters = false,
            Some(filter) if changes => {
                self.changed_ms = tick_ms;
                if !self.chatters {
                    let goes_on = |began: &u64| tick_ms - began < filter.window_ms.into();
                    if self.window_began_ms.filter(goes_on).is_none() {
                        (self.window_began_ms, self.changes) = (Some(tick_ms), 0);
                    }
                    self.changes += 1;
                    self.chatters = self.changes >= filter.changes.get();
                }
            }
            Some(filter) => {
                if self.chatters && tick_ms - self.changed_ms >= filter.rearm_ms.into() {
                    (self.chatters, self.window_began_ms) = (false, None);
                }
            }
        }
        let is_shown = !self.chatters && std::mem::replace(&mut self.recorded, self.on) != self.on;
        self.suppressed += u32::from(changes && !is_shown);
        is_shown
    }
}

impl Recorder {
    /// A recorder as delivered, switched on at tick 0.
    pub(super) fn new(model: Model, debounce_ms: [u8; 32], rtc: NaiveDateTime) -> Recorder {
        let mut recorder = Recorder {
            model,
            strapped_ms: debounce_ms,
            debounce_ms,
            filters: None,
            power_ups: 0,
            life: 0,
            configuration: Configuration::default(),
            rtc,
            refused: Refused::default(),
            last_broadcast: None,
            slots: Vec::new(),
            next_slot: 0,
            total: 0,
            offset_ms: History(Vec::new()),
            source: ClockSource::Battery,
            set_ms: 0,
            mark: None,
            recording: History(Vec::new()),
            accepted: 0,
            recorded: 0,
            differs_since: [None; 32],
            held_back: BTreeMap::new(),
            chatter: [Chatter::default(); 32],
            settled_ms: 0,
        };
        recorder.power_cycle(0);
        // That was making it.
        (recorder.power_ups, recorder.life) = (0, 0);
        recorder
    }

    /// Loses everything except configuration and clock. The inputs as they are now are the
    /// baseline.
    pub(super) fn power_cycle(&mut self, inputs: u32) {
        self.refused = Refused::default();
        self.last_broadcast = None;
        self.mark = None;
        self.power_ups += 1;
        self.erase();
        (self.source, self.set_ms) = (ClockSource::Battery, 0);
        self.offset_ms = History(vec![(0, self.rtc.and_utc().timestamp_millis())]);
        self.recording = History(vec![(0, true)]);
        (self.accepted, self.recorded) = (inputs, inputs);
        self.differs_since = [None; 32];
        self.held_back.clear();
        self.debounce_ms = self.strapped_ms;
        for (bit, chatter) in self.chatter.iter_mut().enumerate() {
            let on = inputs >> bit & 1 == 1;
            *chatter = Chatter { on, recorded: on, ..Chatter::default() };
        }
        self.settled_ms = 0;
    }

    /// The filter of an input, from 0.
    fn filter(&self, index: usize) -> InputFilter {
        let strapped = InputFilter { debounce_ms: self.strapped_ms[index], chatter: None };
        self.filters.map_or(strapped, |filters| filters[index])
    }

    /// The changes of an input, 1–32, that were left out since power-up.
    pub(super) fn suppressed(&self, input: u8) -> u32 {
        self.chatter[usize::from(input) - 1].suppressed
    }

    /// Whether no input has a debounce time, nor gets one.
    pub(super) fn has_no_debounce(&self) -> bool {
        (0..32).all(|index| self.filter(index).debounce_ms == 0 && self.debounce_ms[index] == 0)
    }

    /// Whether nothing is on its way through the filters.
    pub(super) fn is_quiet(&self) -> bool {
        self.differs_since == [None; 32]
            && self.held_back.is_empty()
            && !self.chatter.iter().any(|chatter| chatter.chatters)
            && (0..32).all(|index| self.filter(index).debounce_ms == self.debounce_ms[index])
    }

    /// Other debounce times are taken over between two samples, when no input is being debounced
    /// whose time changes.
    fn change_debounce(&mut self) {
        let wanted: [u8; 32] = std::array::from_fn(|index| self.filter(index).debounce_ms);
        let is_counting = |index: usize| self.differs_since[index].is_some();
        let changes = |index: usize| wanted[index] != self.debounce_ms[index];
        if !(0..32).any(|index| changes(index) && is_counting(index)) {
            self.debounce_ms = wanted;
        }
    }

    /// Entries in use.
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Takes the state of the inputs in millisecond `tick_ms`. Returns what is said because of it.
    pub(super) fn sample(&mut self, tick_ms: u64, inputs: u32) -> Vec<Said> {
        self.change_debounce();
        for index in 0..32 {
            let bit = 1 << index;
            if (inputs ^ self.accepted) & bit == 0 {
                self.differs_since[index] = None;
                continue;
            }
            let began_ms = *self.differs_since[index].get_or_insert(tick_ms);
            if tick_ms - began_ms == u64::from(self.debounce_ms[index]) {
                self.differs_since[index] = None;
                self.accepted ^= bit;
                *self.held_back.entry(began_ms).or_default() |= bit & self.model.mask();
            }
        }
        let longest_ms = self.debounce_ms.into_iter().max().map_or(0, u64::from);
        let mut said = Vec::new();
        while self.settled_ms + longest_ms < tick_ms {
            self.settled_ms += 1;
            let changed = self.held_back.remove(&self.settled_ms).unwrap_or(0);
            let mut shown = 0;
            for index in 0..32 {
                let chatter = self.filter(index).chatter;
                let changes = changed >> index & 1 == 1;
                let is_shown = self.chatter[index].pass(chatter, self.settled_ms, changes);
                shown |= u32::from(is_shown) << index;
            }
            if shown != 0 {
                said.extend(self.record(self.settled_ms, shown));
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
        match Command::parse(body) {
            Ok(command) => self.command(&command, tick_ms, max_entries),
            Err(error) => self.refuse(error),
        }
    }

    /// Takes the body of a datagram to everybody, which is not answered. Returns the command, if
    /// there is one.
    pub(super) fn broadcast(&mut self, body: &[u8], tick_ms: u64) -> Option<Command> {
        match Command::parse(body) {
            Ok(command) => {
                // A command that only asks one recorder for something has no effect.
                if matches!(
                    command,
                    Command::Configure(_)
                        | Command::Erase
                        | Command::SetMode { .. }
                        | Command::SetClock(_)
                        | Command::SetFilter { .. }
                ) {
                    self.command(&command, tick_ms, 0);
                }
                if let Command::SetClock(_) = command {
                    self.source = ClockSource::HostOverGenius;
                }
                if let Command::Time { token } = command {
                    let clock_us = self.now_ms(tick_ms) * 1000;
                    self.mark = Some(Mark { token, clock_us });
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
                (self.source, self.set_ms) = (ClockSource::HostOverRs232, tick_ms);
                vec![Said::Reply(Reply::ClockSet)]
            }
            Command::Identify => vec![Said::Reply(Reply::Identity(self.identity()))],
            Command::Time { token } => {
                vec![Said::Reply(Reply::Time(self.reading(token, tick_ms)))]
            }
            Command::QueryFilters { first } => vec![self.filters_from(first)],
            Command::SetFilter { input, filter } => {
                self.set_filter(input, filter);
                vec![self.filters_from(input.unwrap_or(NonZeroU8::MIN))]
            }
            Command::Diagnostics { first } => vec![Said::Counters(first)],
        }
    }

    fn identity(&self) -> Identity {
        let capabilities = [
            Capabilities::TIME,
            Capabilities::FILTERS,
            Capabilities::DIAGNOSTICS,
            Capabilities::LASTING_COUNTS,
        ];
        Identity {
            level: 1,
            model: self.model,
            firmware: FirmwareVersion {
                major: VERSION / 100,
                minor: VERSION / 10 % 10,
                patch: VERSION % 10,
            },
            capabilities: capabilities.into_iter().fold(Capabilities(0), Capabilities::with),
            id: None,
            power_ups: self.power_ups,
            life: self.life,
            log_capacity: 2048,
            guard: Guard::None,
        }
    }

    fn reading(&self, token: u16, tick_ms: u64) -> ClockReading {
        ClockReading {
            token,
            clock_us: self.now_ms(tick_ms) * 1000,
            source: self.source,
            age_s: u32::try_from((tick_ms - self.set_ms) / 1000).expect("seconds"),
            doubt_us: None,
            drift_ppb: None,
            tick_us: tick_ms * 1000,
            life: self.life,
            next_sequence: self.total + 1,
            last_mark: self.mark,
        }
    }

    fn filters_from(&self, first: NonZeroU8) -> Said {
        let inputs = first.get()..=self.model.inputs();
        let filters = inputs.take(20).map(|number| self.filter(usize::from(number) - 1));
        Said::Reply(Reply::Filters(Filters { first, filters: filters.collect() }))
    }

    fn set_filter(&mut self, input: Option<NonZeroU8>, filter: InputFilter) {
        let inputs = usize::from(self.model.inputs());
        let mut filters = [InputFilter::OFF; 32];
        for (index, place) in filters.iter_mut().enumerate().take(inputs) {
            let is_meant = input.is_none_or(|input| usize::from(input.get()) == index + 1);
            *place = if is_meant { filter } else { self.filter(index) };
            if place.chatter != self.filter(index).chatter {
                self.chatter[index].window_began_ms = None;
            }
        }
        self.refused.parameters +=
            u32::from(input.is_some_and(|input| usize::from(input.get()) > inputs));
        self.filters = Some(filters);
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
        self.total += 1;
    }

    fn erase(&mut self) {
        self.slots.clear();
        self.next_slot = 0;
        self.total = 0;
        self.life += 1;
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
            total: u16::try_from(self.total % (1 << 16)).expect("two bytes"),
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
