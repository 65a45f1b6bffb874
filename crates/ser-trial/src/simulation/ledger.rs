//! What a recorder must have recorded, worked out only from what was done to it, never from what it
//! says.
//!
//! Every edge of every contact goes through here. It is filtered by debounce, stamped by the clock
//! as set at that moment, and recorded or not depending on the mode. The result is a list of events
//! that is never erased nor overwritten. Erases are marks in the list, between the events that they
//! can have come between.

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::num::NonZeroU8;
use std::ops::RangeInclusive;

use ser_node::capture::QUEUE_LEN;
use ser_node::{Debounce, HELD_BACK_MS};
use ser_proto::{
    ClockSource, Command, Configuration, Entry, Filters, Identity, InputFilter, MAX_SIZE, Mark,
    Model, Reply, TimeStamp,
};

use super::chatter_model::ChatterModel;
use super::counts::{Bounds, Expected};
use super::debounce_model::{Accepted, DebounceModel};
use super::filter_orders::{FilterOrder, FilterTable, FiltersQuestion, times};
use super::port::Port;
use super::questions::{Answers, Questions, TimeQuestion};
use super::recorded::{Erase, Recorded, stamp_ms};
use super::wrong::{Numbered, Told, Wrong, erases};

/// A hundred years, 1970–2069: what two-digit years can tell apart.
const CENTURY_MS: i64 = 36_525 * 86_400_000;

/// How many events are kept at least. That is more than a log holds, and more than a plant produces
/// while a printed line waits for a host that is stuck.
const KEPT: usize = 1 << 17;

/// How long a reply with older settings may be on its way.
const SETTINGS_SETTLE_MS: u64 = 120_000;

/// What became of edges. Each edge is in one of these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// All edges of the contacts.
    pub applied: u64,
    /// Recorded in events.
    pub recorded: u64,
    /// While recording was stopped.
    pub stopped: u64,
    /// Too short for debounce.
    pub filtered: u64,
    /// Chatter, left out and counted by the recorder.
    pub chatter: u64,
    /// Beyond the capture queue, while the main loop was held up.
    pub queue_full: u64,
    /// Not processed when the power was cut.
    pub cut_off: u64,
    /// Not processed yet.
    pub undecided: u64,
    /// Not edges, but places at which the log shows where an input came to rest after chatter.
    pub rests: u64,
}

/// A change of the log that was asked for, while it is not known when it is done.
#[derive(Clone, Copy, Debug)]
enum Due {
    /// The erase of this number.
    Erase(usize),
    /// A configuration.
    Size {
        /// `None` if it leaves the size alone.
        to: Option<u16>,
        /// Whether the size was changed over another port meanwhile. The answer may then be from
        /// before that.
        doubtful: bool,
    },
}

/// What is known of one millisecond and not yet recorded.
#[derive(Clone, Copy, Debug, Default)]
struct Waiting {
    /// Inputs that changed in it.
    changed: u32,
    /// Inputs whose earlier changes did not fit the capture queue. The sample of this millisecond
    /// is the first to show them.
    dropped: u32,
}

/// How the clock is set.
#[derive(Clone, Copy, Debug)]
struct Setting {
    /// How far it is ahead of the simulation's time.
    ahead_ms: i64,
    source: ClockSource,
    /// When it was set, in microseconds since power-up.
    tick_us: u64,
}

impl Default for Setting {
    fn default() -> Setting {
        Setting { ahead_ms: 0, source: ClockSource::NeverSet, tick_us: 0 }
    }
}

/// The ledger of one recorder, over all its lives.
#[derive(Clone, Debug)]
pub struct Ledger {
    /// What it must have counted since power-up, as far as that is counted where it happens.
    pub expected: Expected,
    mask: u32,
    hold_ms: u64,
    debounce: DebounceModel,
    /// Accepted changes that are held back, because an earlier change or an unread datagram may
    /// still come before them.
    waiting: BTreeMap<u64, Waiting>,
    /// When the oldest datagram arrived that the recorder has not taken from its board.
    wait_after_ms: Option<u64>,
    /// Inputs whose changes did not fit the capture queue since the latest accepted change.
    dropped: u32,
    chatter: ChatterModel,
    /// The contacts now, the inputs after the changes that were decided, and those as the log has
    /// to show them.
    contacts: u32,
    inputs: u32,
    state: u32,
    /// What the latest event shows. What has changed since without an event was recorded nowhere.
    shown: u32,
    /// When the power came on, and for how much longer the recorder has been on since.
    power_up_ms: u64,
    older_ms: u64,
    model: Model,
    /// The filters since power-up, by input; the last are in force.
    filters: Vec<FilterTable>,
    /// How often they were set, in all lives.
    filters_set: u64,
    questions: Questions,
    /// How many erases had certainly happened when somebody asked for the identity.
    identity_asked: VecDeque<(Port, u64)>,
    /// Erases that arrived and that certainly happened, in earlier lives.
    erases_before: (u64, u64),
    /// From which millisecond on the clock is set how.
    clock: Vec<(u64, Setting)>,
    recording: Vec<(u64, bool)>,
    events: VecDeque<Recorded>,
    /// How many events at the beginning of the list were dropped because nobody can be told of
    /// them.
    forgotten: usize,
    erases: Vec<Erase>,
    /// Each with the time by which it will have been done, or never will be.
    due: VecDeque<(Port, u64, Due)>,
    size: u16,
    /// The settings in force, where they are known. The power does not change them.
    configuration: Option<Configuration>,
    /// From when on the settings are known again. On a bus one does not see when a reply is made.
    known_from_ms: u64,
    now_ms: u64,
    /// Events before this one can have been overwritten.
    overwritten_before: usize,
    life: u64,
    edges: Edges,
    /// Edges beyond the capture queue in earlier lives.
    queue_full_before: u64,
    /// When the latest change happened that was decided.
    decided_ms: u64,
    /// How many configurations arrived since power-up.
    configurations: u64,
    /// Edges that debounce filtered in earlier lives.
    filtered_before: u64,
    accepted: Vec<Accepted>,
}

impl Ledger {
    /// A recorder without power, whose contacts are open.
    #[must_use]
    pub fn new(model: Model) -> Ledger {
        Ledger {
            expected: Expected::default(),
            mask: model.mask(),
            hold_ms: 0,
            debounce: DebounceModel::new(Debounce::OFF, 0),
            waiting: BTreeMap::new(),
            wait_after_ms: None,
            dropped: 0,
            chatter: ChatterModel::default(),
            contacts: 0,
            inputs: 0,
            state: 0,
            shown: 0,
            power_up_ms: 0,
            older_ms: 0,
            model,
            filters: vec![[InputFilter::OFF; 32]],
            filters_set: 0,
            questions: Questions::default(),
            identity_asked: VecDeque::new(),
            erases_before: (0, 0),
            clock: Vec::new(),
            recording: Vec::new(),
            events: VecDeque::new(),
            forgotten: 0,
            erases: Vec::new(),
            due: VecDeque::new(),
            size: 0,
            configuration: None,
            known_from_ms: 0,
            now_ms: 0,
            overwritten_before: 0,
            life: 0,
            edges: Edges::default(),
            queue_full_before: 0,
            decided_ms: 0,
            configurations: 0,
            filtered_before: 0,
            accepted: Vec::new(),
        }
    }

    /// Switches the power on. The clock shows `time_ms`, which it has from `source`.
    pub fn power_up(
        &mut self,
        now_ms: u64,
        (source, time_ms): (ClockSource, i64),
        size: u16,
        filters: &FilterTable,
    ) {
        self.expected = Expected::default();
        self.queue_full_before = self.edges.queue_full;
        (self.decided_ms, self.configurations) = (0, 0);
        self.edges.cut_off += self.undecided();
        self.chatter = ChatterModel::default();
        self.begin_filters(filters);
        (self.power_up_ms, self.older_ms) = (now_ms, 0);
        self.questions.power_up();
        self.identity_asked.clear();
        let certain = self.erases.iter().filter(|erase| erase.certain).count();
        self.erases_before.0 += self.erases.len() as u64;
        self.erases_before.1 += certain as u64;
        self.waiting.clear();
        self.wait_after_ms = None;
        self.dropped = 0;
        self.inputs = self.contacts & self.mask;
        (self.state, self.shown) = (self.inputs, self.inputs);
        self.clock = vec![(0, Setting { ahead_ms: time_ms - signed(now_ms), source, tick_us: 0 })];
        self.recording = vec![(0, true)];
        self.events.clear();
        self.forgotten = 0;
        self.erases.clear();
        self.due.clear();
        self.size = size;
        self.overwritten_before = 0;
        self.life += 1;
    }

    /// At power-up these filters are in force, by input.
    fn begin_filters(&mut self, filters: &FilterTable) {
        self.filtered_before += self.debounce.filtered();
        self.debounce = DebounceModel::new(times(filters), self.contacts);
        self.hold_ms = self.debounce.times().longest_ms().into();
        for (bit, filter) in filters.iter().enumerate() {
            self.chatter.set(bit, filter.chatter);
        }
        self.filters = vec![*filters];
    }

    /// A host orders a filter. The recorder sets it at once or later, or never.
    fn filters_ordered(&mut self, port: Port, order: FilterOrder) {
        let first = order.input.unwrap_or(NonZeroU8::MIN);
        let since = self.filters.len() - 1;
        let question = FiltersQuestion { first, order: Some(order), since };
        self.questions.ask_filters(port, self.now_ms, question);
    }

    /// Whether a host has ordered a filter that the recorder may still set.
    #[must_use]
    pub fn may_set_filters(&self) -> bool {
        self.questions.filters_ordered(self.now_ms).next().is_some()
    }

    /// The recorder has stored these filters since the sample of this millisecond, and changes that
    /// it has not recorded yet go by them. Debounce follows before the next sample that it can.
    ///
    /// # Errors
    /// When nobody has ordered them.
    pub fn filters_stored(&mut self, stored: &FilterTable) -> Result<(), String> {
        let before = *self.filters();
        if *stored == before {
            return Ok(());
        }
        let inputs = self.model.inputs();
        let ordered = || self.questions.filters_ordered(self.now_ms);
        // Both ports may have set one in the same millisecond.
        let is_ordered = ordered().any(|one| {
            let once = one.applied_to(&before, inputs);
            once == *stored || ordered().any(|other| other.applied_to(&once, inputs) == *stored)
        });
        if !is_ordered {
            return Wrong::new("the recorder has filters that nobody has ordered")
                .fact("stored", format_args!("{stored:?}"))
                .fact("before", format_args!("{before:?}"))
                .fact("ordered", format_args!("{:?}", ordered().collect::<Vec<_>>()))
                .err();
        }
        for (bit, filter) in stored.iter().enumerate() {
            self.chatter.set(bit, filter.chatter);
        }
        self.filters.push(*stored);
        self.filters_set += 1;
        Ok(())
    }

    /// Before the next sample, debounce takes over the times that are ordered, if it can.
    pub fn take_debounce_times(&mut self) {
        let wanted = times(self.filters());
        if wanted == *self.debounce.times() {
            return;
        }
        self.debounce.take_times(&wanted);
        if wanted == *self.debounce.times() {
            // Changes that only waited for a datagram are recorded as if nothing had happened.
            self.record_until(self.now_ms.saturating_sub(1));
            self.hold_ms = self.debounce.times().longest_ms().into();
        }
    }

    /// Whether every change counts at once.
    #[must_use]
    pub fn is_undebounced(&self) -> bool {
        *self.debounce.times() == Debounce::OFF
    }

    /// How often filters were set, in all lives.
    #[must_use]
    pub fn filters_set(&self) -> u64 {
        self.filters_set
    }

    /// The filters in force, by input.
    #[must_use]
    pub fn filters(&self) -> &FilterTable {
        self.filters.last().unwrap_or(&[InputFilter::OFF; 32])
    }

    /// Inputs that chatter.
    #[must_use]
    pub fn chattering(&self) -> u32 {
        self.chatter.chattering()
    }

    /// How many changes of each input were left out since power-up.
    #[must_use]
    pub fn left_out(&self) -> [u32; 32] {
        self.chatter.left_out()
    }

    /// What became of questions.
    #[must_use]
    pub fn answers(&self) -> Answers {
        self.questions.answers
    }

    /// Ages the recorder: it has been on for that much longer, and its clock has gone on.
    pub fn grow_older(&mut self, by_ms: u64) {
        self.older_ms += by_ms;
        for (_, setting) in &mut self.clock {
            setting.ahead_ms += signed(by_ms);
        }
    }

    /// Edges that are not decided yet.
    fn undecided(&self) -> u64 {
        let waiting: u64 =
            self.waiting.values().map(|waiting| u64::from(waiting.changed.count_ones())).sum();
        waiting + self.debounce.unsettled()
    }

    /// Contacts move in this millisecond.
    pub fn contacts_moved(&mut self, at_ms: u64, changed: u32) {
        self.contacts ^= changed;
        let changed = changed & self.mask;
        self.edges.applied += u64::from(changed.count_ones());
        let mut accepted = std::mem::take(&mut self.accepted);
        self.debounce.change(at_ms, changed, &mut accepted);
        self.take_accepted(&mut accepted);
        self.accepted = accepted;
    }

    /// Contacts move, one move per millisecond, while the main loop is held up. Only for recorders
    /// without debounce.
    pub fn contacts_moved_unseen(&mut self, moves: impl Iterator<Item = (u64, u32)>) {
        for (count, (at_ms, changed)) in moves.enumerate() {
            if count < QUEUE_LEN {
                self.contacts_moved(at_ms, changed);
                self.settle(at_ms);
                continue;
            }
            // The change takes effect without an event.
            self.contacts ^= changed;
            let changed = changed & self.mask;
            self.dropped ^= changed;
            self.debounce.follow(changed);
            self.edges.applied += u64::from(changed.count_ones());
            self.edges.queue_full += u64::from(changed.count_ones());
        }
    }

    /// The sample of this millisecond has been taken.
    pub fn settle(&mut self, now_ms: u64) {
        self.now_ms = now_ms;
        let mut accepted = std::mem::take(&mut self.accepted);
        self.debounce.settle(now_ms, &mut accepted);
        self.take_accepted(&mut accepted);
        self.accepted = accepted;
        self.record_until(now_ms);
    }

    /// Makes changes after this millisecond wait for a datagram that arrived in it, at most as long
    /// as a recorder holds changes back.
    pub fn wait_after(&mut self, arrived_ms: Option<u64>) {
        self.wait_after_ms = arrived_ms;
    }

    /// Records what has nothing to wait for once the sample of this millisecond has been taken.
    fn record_until(&mut self, now_ms: u64) {
        let (in_order_ms, held_ms) =
            (now_ms.saturating_sub(self.hold_ms), now_ms.saturating_sub(HELD_BACK_MS));
        let decided_ms = self
            .wait_after_ms
            .map_or(in_order_ms, |arrived_ms| in_order_ms.min(arrived_ms.max(held_ms)));
        while let Some(first) = self.waiting.first_entry()
            && *first.key() <= decided_ms
        {
            let (at_ms, Waiting { changed, dropped }) = first.remove_entry();
            self.decided_ms = at_ms;
            self.rest_until(at_ms.saturating_sub(1));
            self.chatter.settled(at_ms.saturating_sub(1));
            let chattered = self.chatter.chattering();
            self.inputs ^= dropped ^ changed;
            self.state ^= dropped & !chattered;
            self.decide(at_ms, changed);
        }
        self.rest_until(decided_ms);
        self.chatter.settled(decided_ms);
    }

    /// Lets inputs come to rest that have been quiet for long enough by this millisecond.
    fn rest_until(&mut self, until_ms: u64) {
        while let Some(at_ms) = self.chatter.next_rest_ms().filter(|&at_ms| at_ms <= until_ms) {
            self.decide(at_ms, 0);
        }
    }

    /// Decides what is recorded of inputs that changed in this millisecond, and of those that come
    /// to rest in it.
    fn decide(&mut self, at_ms: u64, changed: u32) {
        let ended = self.chatter.end_switched_off();
        let shown_anew = ended & (self.inputs ^ self.state);
        let mut recorded = changed;
        for bit in (0..32_usize).filter(|bit| changed >> bit & 1 == 1) {
            if (ended & !shown_anew) >> bit & 1 == 1 {
                self.chatter.leave_out(bit);
                recorded &= !(1 << bit);
                self.edges.chatter += 1;
            } else if !self.chatter.change(bit, at_ms) {
                recorded &= !(1 << bit);
                self.edges.chatter += 1;
            }
        }
        let edges = u64::from(recorded.count_ones());
        let rests = (self.chatter.rest(at_ms) | ended) & (self.inputs ^ self.state) & !recorded;
        self.state ^= recorded | rests;
        if recorded | rests != 0 {
            self.record(at_ms, recorded | rests, edges);
        }
    }

    fn take_accepted(&mut self, accepted: &mut Vec<Accepted>) {
        if let Some((_, at_ms)) = accepted.first() {
            // Events that are already waiting do not know of the dropped changes.
            self.waiting.entry(*at_ms).or_default().dropped ^= std::mem::take(&mut self.dropped);
        }
        for (bit, at_ms) in accepted.drain(..) {
            self.waiting.entry(at_ms).or_default().changed |= 1 << bit;
        }
    }

    fn record(&mut self, at_ms: u64, changed: u32, edges: u64) {
        if !in_force(&self.recording, at_ms) {
            self.edges.stopped += edges;
            return;
        }
        self.edges.recorded += edges;
        self.edges.rests += u64::from(changed.count_ones()) - edges;
        let stamp_ms =
            (in_force(&self.clock, at_ms).ahead_ms + signed(at_ms)).rem_euclid(CENTURY_MS);
        let unrecorded = self.shown ^ self.state ^ changed;
        self.shown = self.state;
        self.events.push_back(Recorded { stamp_ms, changed, state: self.state, at_ms, unrecorded });
        self.note_overwritten();
    }

    /// Notes which events the smallest possible log no longer holds.
    fn note_overwritten(&mut self) {
        let size = usize::from(self.smallest_size());
        self.overwritten_before = self.overwritten_before.max(self.len().saturating_sub(size));
    }

    /// The smallest size that the log can have.
    #[must_use]
    pub fn smallest_size(&self) -> u16 {
        let sizes = self.due.iter().filter_map(|(_, _, due)| match due {
            Due::Size { to, .. } => *to,
            Due::Erase(_) => None,
        });
        sizes.fold(self.size, u16::min)
    }

    /// The clock was set in this millisecond. Samples after it have the new time, except for those
    /// that have been recorded since.
    pub fn set_clock(&mut self, port: Port, at_ms: u64, time: TimeStamp) {
        let Some(time_ms) = stamp_ms(time) else { return };
        self.count_late(at_ms);
        let source = match port {
            Port::Line => ClockSource::HostOverRs232,
            Port::Bus => ClockSource::HostOverGenius,
        };
        let tick_us = self.tick_us(at_ms);
        let setting = Setting { ahead_ms: time_ms - signed(at_ms), source, tick_us };
        set(&mut self.clock, at_ms, setting);
    }

    /// Counts a setting of this millisecond that comes after a later change was decided.
    fn count_late(&mut self, at_ms: u64) {
        self.expected.exact.settings_late += u32::from(self.decided_ms > at_ms);
    }

    /// Recording was started or stopped in this millisecond, after its sample.
    pub fn set_recording(&mut self, at_ms: u64, recording: bool) {
        self.count_late(at_ms);
        set(&mut self.recording, at_ms, recording);
    }

    /// The time that the clock shows.
    #[must_use]
    pub fn time_ms(&self, now_ms: u64) -> i64 {
        let ahead_ms = self.clock.last().map_or(0, |(_, setting)| setting.ahead_ms);
        (ahead_ms + signed(now_ms)).rem_euclid(CENTURY_MS)
    }

    /// A command has arrived that waits for its turn. What it changes is done by `until_ms`, or
    /// never.
    pub fn command_arrived(&mut self, port: Port, command: &Command, until_ms: u64) {
        let size = self.smallest_size();
        self.expected.command(port, command, self.model.inputs(), size);
        match command {
            Command::Erase => {
                self.erases.push(Erase { from: self.len(), to: usize::MAX, certain: false });
                self.due.push_back((port, until_ms, Due::Erase(self.erases.len() - 1)));
            }
            // Its answer looks the same as a configuration's.
            Command::QueryConfiguration => {
                self.due.push_back((port, until_ms, Due::Size { to: None, doubtful: false }));
            }
            Command::Configure(configure) => {
                self.configurations += 1;
                self.forget_configuration(port);
                self.due.push_back((
                    port,
                    until_ms,
                    Due::Size { to: configure.size, doubtful: false },
                ));
                self.note_overwritten();
            }
            Command::SetFilter { input, filter } => {
                self.filters_ordered(port, FilterOrder { input: *input, filter: *filter });
            }
            Command::QueryFilters { first } => {
                let since = self.filters.len() - 1;
                let question = FiltersQuestion { first: *first, order: None, since };
                self.questions.ask_filters(port, self.now_ms, question);
            }
            Command::Identify => {
                let certain = self.erases.iter().filter(|erase| erase.certain).count();
                self.identity_asked.push_back((port, certain as u64));
            }
            Command::Diagnostics { first } => {
                let bounds = self.counter_bounds(port);
                self.questions.ask_counters(port, self.now_ms, *first, bounds);
            }
            _ => {}
        }
    }

    /// A question for the time has arrived in this millisecond.
    pub fn time_asked(&mut self, port: Port, token: u16, at_ms: u64) {
        let counted = |place: usize| (self.len() - place) as u64;
        let places = self.may_count_from();
        let events = places.map(|places| counted(*places.end())..=counted(*places.start()));
        let certain = self.erases.iter().filter(|erase| erase.certain).count() as u64;
        let question = TimeQuestion {
            token,
            clock_us: self.clock_us(at_ms),
            source: self.source_and_age_s(at_ms),
            tick_us: self.tick_us(at_ms),
            lives: self.lives(certain),
            events: events.collect(),
        };
        self.questions.ask_time(port, self.now_ms, question);
    }

    /// Which lives of the log it can be, when so many erases since power-up were certain.
    fn lives(&self, certain: u64) -> RangeInclusive<u64> {
        let (arrived_before, certain_before) = self.erases_before;
        let most = self.life + arrived_before + self.erases.len() as u64;
        self.life + certain_before + certain..=most
    }

    /// A mark has arrived in this millisecond.
    pub fn marked(&mut self, token: u16, at_ms: u64) {
        let clock_us = self.clock_us(at_ms);
        self.questions.mark(Mark { token, clock_us });
    }

    /// What the clock shows in this millisecond. A setting in it counts.
    fn clock_us(&self, at_ms: u64) -> i64 {
        let ahead_ms = in_force(&self.clock, at_ms + 1).ahead_ms;
        (ahead_ms + signed(at_ms)).rem_euclid(CENTURY_MS) * 1000
    }

    /// Where the clock has its time from in this millisecond, and for how many seconds.
    fn source_and_age_s(&self, at_ms: u64) -> (ClockSource, u32) {
        let Setting { source, tick_us, .. } = in_force(&self.clock, at_ms + 1);
        let age_s = (self.tick_us(at_ms) - tick_us) / 1_000_000;
        (source, u32::try_from(age_s).unwrap_or(u32::MAX))
    }

    /// What the recorder must have counted by now.
    #[must_use]
    pub fn expected_by_now(&self) -> Expected {
        let mut expected = self.expected;
        expected.exact.edges_lost = narrow(self.edges.queue_full - self.queue_full_before);
        expected.overwritten = narrow(self.overwritten_before as u64);
        let events = (self.len() + self.erases.len()) as u64;
        expected.reportable = narrow(events + self.configurations);
        expected
    }

    /// The least and the most that each counter can be now that is asked for by this port.
    fn counter_bounds(&self, asked_by: Port) -> Bounds {
        let left_out = &self.chatter.left_out()[..self.model.inputs().into()];
        self.expected_by_now().all_bounds(asked_by, left_out)
    }

    fn tick_us(&self, at_ms: u64) -> u64 {
        (at_ms - self.power_up_ms + self.older_ms) * 1000
    }

    /// A command has arrived and been carried out at once.
    pub fn command_done(&mut self, command: &Command) {
        match command {
            Command::Erase => {
                self.erases.push(Erase { from: self.len(), to: self.len(), certain: true });
            }
            Command::Configure(configure) => {
                self.configurations += 1;
                self.forget_configuration(Port::Bus);
                if let Some(size) = configure.size {
                    self.size = size;
                    self.doubt_answers(|_| true);
                }
                self.note_overwritten();
            }
            Command::SetFilter { input, filter } => {
                self.filters_ordered(Port::Bus, FilterOrder { input: *input, filter: *filter });
            }
            _ => {}
        }
    }

    fn forget_configuration(&mut self, port: Port) {
        self.configuration = None;
        if port == Port::Bus {
            self.known_from_ms = self.now_ms + SETTINGS_SETTLE_MS;
        }
    }

    /// A reply has been seen: on the line when it goes out, on the bus when it arrives.
    ///
    /// # Errors
    /// When it tells other settings than those in force.
    pub fn replied(&mut self, port: Port, reply: &Reply) -> Result<(), String> {
        match reply {
            Reply::Erased => {
                let done = self.finish(|of, _, due| of == port && matches!(due, Due::Erase(_)));
                if let Some(Due::Erase(number)) = done {
                    self.erases[number].certain = true;
                }
            }
            Reply::Configuration(configuration) => {
                let done = self.finish(|of, _, due| of == port && matches!(due, Due::Size { .. }));
                let certain = matches!(done, Some(Due::Size { doubtful: false, .. }));
                self.size =
                    if certain { configuration.size } else { self.size.min(configuration.size) };
                self.note_overwritten();
                if port == Port::Line {
                    self.see_configuration(*configuration)?;
                }
            }
            Reply::Time(reading) => self.questions.check_time(port, self.now_ms, reading)?,
            Reply::Diagnostics(page) => {
                let bounds = self.counter_bounds(port);
                self.questions.check_counters(port, self.now_ms, page, &bounds)?;
            }
            Reply::Identity(identity) => self.see_identity(port, identity)?,
            Reply::Filters(page) => self.see_filters(port, page)?,
            _ => {}
        }
        Ok(())
    }

    fn see_identity(&mut self, port: Port, identity: &Identity) -> Result<(), String> {
        // Until the reply is seen, other commands may have been carried out.
        let of_port = |(of, _): &(Port, u64)| *of == port;
        let asked = self.identity_asked.iter().position(of_port);
        let asked = asked.and_then(|place| self.identity_asked.remove(place));
        let certain = asked.map_or(0, |(_, certain)| certain);
        let lives = self.lives(certain);
        self.questions.check_identity(identity, self.model, self.life, lives)
    }

    fn see_filters(&mut self, port: Port, page: &Filters) -> Result<(), String> {
        let (inputs, now_ms) = (self.model.inputs(), self.now_ms);
        self.questions.check_filters(port, now_ms, page, &self.filters, inputs)
    }

    fn see_configuration(&mut self, configuration: Configuration) -> Result<(), String> {
        if let Some(known) = self.configuration.filter(|known| *known != configuration) {
            return Wrong::new("the recorder tells other settings than were set last")
                .fact("tells", format_args!("{configuration:?}"))
                .fact("set last", format_args!("{known:?}"))
                .err();
        }
        let others_due = self.due.iter().any(|(_, _, due)| matches!(due, Due::Size { .. }));
        let settled = !others_due && self.now_ms >= self.known_from_ms;
        self.configuration = settled.then_some(configuration);
        Ok(())
    }

    /// Closes the changes whose time is over: they have been done, or never will be.
    pub fn expire(&mut self, now_ms: u64) {
        while self.due.iter().any(|&(_, until_ms, _)| until_ms <= now_ms) {
            self.finish(|_, until_ms, _| until_ms <= now_ms);
        }
    }

    /// Takes the oldest matching change, which has been done or never will be.
    fn finish(&mut self, is: impl Fn(Port, u64, &Due) -> bool) -> Option<Due> {
        let index = self.due.iter().position(|(of, until_ms, due)| is(*of, *until_ms, due))?;
        let (port, _, due) = self.due.remove(index)?;
        match due {
            Due::Erase(number) => self.erases[number].to = self.len(),
            Due::Size { to: Some(size), .. } => {
                // The next configuration tells which of the two sizes it is.
                self.size = self.size.min(size);
                self.doubt_answers(|other| other != port);
            }
            Due::Size { to: None, .. } => {}
        }
        self.note_overwritten();
        Some(due)
    }

    /// The size has changed. Answers that wait in the queue of a port may be from before that.
    fn doubt_answers(&mut self, of: impl Fn(Port) -> bool) {
        for (_, _, due) in self.due.iter_mut().filter(|(port, ..)| of(*port)) {
            if let Due::Size { doubtful, .. } = due {
                *doubtful = true;
            }
        }
    }

    /// Checks what a recorder holds in its log: the total, and its entries from the oldest to the
    /// newest.
    ///
    /// # Errors
    /// The first difference.
    pub fn check_log(&self, total: u16, entries: &[Entry]) -> Result<(), String> {
        let len = self.len();
        let Some(first) = len.checked_sub(entries.len()) else {
            return Err(format!("the log holds {} entries of {len} events", entries.len()));
        };
        let wrong = entries.iter().enumerate().rev().find(|(place, entry)| {
            let event = self.event(first + place);
            !event.is_some_and(|event| event.is(entry))
        });
        if let Some((place, entry)) = wrong {
            let index = first + place;
            return Wrong::new(format!("the log holds another entry as event {index} of {len}"))
                .fact("holds", Told(entry))
                .fact("due", self.numbered(index))
                .err();
        }
        let counts_from = |from: usize| from <= first && low_16(len - from) == total;
        let Some(from) = self.may_count_from().flatten().find(|&from| counts_from(from)) else {
            return Wrong::new(format!(
                "the log counts {total} events, and cannot have had so many"
            ))
            .fact("recorded", format_args!("{len} events since power-up"))
            .fact("holds", format_args!("{} entries", entries.len()))
            .fact("erases", erases(self.erases.iter().copied()))
            .err();
        };
        let oldest_kept = self.overwritten_before.max(from);
        if first > oldest_kept {
            return Wrong::new(format!("event {oldest_kept} must be there, and is not in the log"))
                .fact("due", self.numbered(oldest_kept))
                .fact("log begins with", self.numbered(first))
                .err();
        }
        let most = self.configuration.map_or(MAX_SIZE, |configuration| configuration.size);
        if entries.len() > most.into() {
            return Err(format!("the log holds {} entries, and its size is {most}", entries.len()));
        }
        Ok(())
    }

    /// Indices from which on the total may count, which are all places where the latest erase can
    /// have been, erase by erase. Erases are not done in the order in which they arrive, because each port has its
    /// own queue.
    fn may_count_from(&self) -> impl Iterator<Item = RangeInclusive<usize>> {
        let certain = self.erases.iter().filter(|erase| erase.certain);
        let earliest = certain.map(|erase| erase.from).max().unwrap_or(0);
        let len = self.len();
        let erases = self.erases.iter().copied().chain([Erase::POWER_UP]);
        let places = erases.map(move |erase| erase.from.max(earliest)..=erase.to.min(len));
        places.filter(|places| !places.is_empty())
    }

    /// How many events there were since power-up.
    #[must_use]
    pub fn len(&self) -> usize {
        self.forgotten + self.events.len()
    }

    /// Whether there were none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The event of this index.
    #[must_use]
    pub fn event(&self, index: usize) -> Option<&Recorded> {
        self.events.get(index.checked_sub(self.forgotten)?)
    }

    /// The event of this index, in words.
    #[must_use]
    pub fn numbered(&self, number: usize) -> Numbered<'_> {
        Numbered { number, of: self.len(), event: self.event(number) }
    }

    /// The events that are remembered, from the newest to the oldest.
    pub fn latest(&self) -> impl Iterator<Item = &Recorded> {
        self.events.iter().rev()
    }

    /// The erases since power-up.
    #[must_use]
    pub fn erases(&self) -> &[Erase] {
        &self.erases
    }

    /// Events before this one can have been overwritten.
    #[must_use]
    pub fn overwritten_before(&self) -> usize {
        self.overwritten_before
    }

    /// Which life this is, from 1.
    #[must_use]
    pub fn life(&self) -> u64 {
        self.life
    }

    /// Forgets the events before this one, which nobody can read or print any more.
    pub fn forget_before(&mut self, index: usize) {
        let held = self.len().saturating_sub(KEPT);
        let count = index.min(held).saturating_sub(self.forgotten);
        self.events.drain(..count);
        self.forgotten += count;
    }

    /// What became of all edges.
    #[must_use]
    pub fn edges(&self) -> Edges {
        let undecided = self.undecided();
        // Where a contact has come back before its change was accepted, both edges count as
        // filtered.
        let filtered = self.debounce.filtered() + self.filtered_before;
        Edges { filtered, undecided, ..self.edges }
    }
}

/// Inserts a setting in order of time. Settings from the other port may have been read before it.
fn set<T>(settings: &mut Vec<(u64, T)>, at_ms: u64, value: T) {
    let place = settings.partition_point(|&(from_ms, _)| from_ms <= at_ms);
    settings.insert(place, (at_ms, value));
}

/// What was set last before the sample of a millisecond was taken.
fn in_force<T: Copy + Default>(settings: &[(u64, T)], at_ms: u64) -> T {
    let before = settings.iter().rev().find(|(from_ms, _)| *from_ms < at_ms);
    before.or(settings.first()).map_or(T::default(), |&(_, value)| value)
}

#[expect(clippy::cast_possible_truncation, reason = "the total wraps")]
fn low_16(count: usize) -> u16 {
    count as u16
}

fn narrow(count: u64) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

fn signed(ms: u64) -> i64 {
    i64::try_from(ms).unwrap_or(i64::MAX)
}
