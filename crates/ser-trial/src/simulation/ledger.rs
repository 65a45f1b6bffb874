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

use ser_node::capture::QUEUE_LEN;
use ser_node::{Debounce, HELD_BACK_MS};
use ser_proto::{Command, Configuration, Entry, MAX_SIZE, Reply, TimeStamp};

use super::debounce_model::{Accepted, DebounceModel};
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
    /// Beyond the capture queue, while the main loop was held up.
    pub queue_full: u64,
    /// Not processed when the power was cut.
    pub cut_off: u64,
    /// Not processed yet.
    pub undecided: u64,
}

/// The port that a command came by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// RS-232.
    Line,
    /// Genius.
    Bus,
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

/// The ledger of one recorder, over all its lives.
#[derive(Clone, Debug)]
pub struct Ledger {
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
    /// The contacts now, and the inputs as of the latest event.
    contacts: u32,
    state: u32,
    /// Inputs that changed since the latest event while recording was stopped, or beyond the
    /// capture queue.
    unrecorded: u32,
    /// From which millisecond on the clock is ahead of the simulation's time, and by how much.
    clock: Vec<(u64, i64)>,
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
    /// Edges that debounce filtered in earlier lives.
    filtered_before: u64,
    accepted: Vec<Accepted>,
}

impl Ledger {
    /// A recorder without power, whose contacts are open.
    #[must_use]
    pub fn new(mask: u32) -> Ledger {
        Ledger {
            mask,
            hold_ms: 0,
            debounce: DebounceModel::new(Debounce::OFF, 0),
            waiting: BTreeMap::new(),
            wait_after_ms: None,
            dropped: 0,
            contacts: 0,
            state: 0,
            unrecorded: 0,
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
            filtered_before: 0,
            accepted: Vec::new(),
        }
    }

    /// Switches the power on; the clock shows `time_ms`.
    pub fn power_up(&mut self, now_ms: u64, time_ms: i64, size: u16, debounce: Debounce) {
        self.edges.cut_off += self.undecided();
        self.filtered_before += self.debounce.filtered();
        self.hold_ms = debounce.longest_ms().into();
        self.debounce = DebounceModel::new(debounce, self.contacts);
        self.waiting.clear();
        self.wait_after_ms = None;
        self.dropped = 0;
        self.state = self.contacts & self.mask;
        self.unrecorded = 0;
        self.clock = vec![(0, time_ms - signed(now_ms))];
        self.recording = vec![(0, true)];
        self.events.clear();
        self.forgotten = 0;
        self.erases.clear();
        self.due.clear();
        self.size = size;
        self.overwritten_before = 0;
        self.life += 1;
    }

    /// Ages the recorder: it has been on for that much longer, and its clock has gone on.
    pub fn grow_older(&mut self, by_ms: u64) {
        for (_, ahead_ms) in &mut self.clock {
            *ahead_ms += signed(by_ms);
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
        while let Some(first) = self.waiting.first_entry() {
            let at_ms = *first.key();
            let waits = self.wait_after_ms.is_some_and(|arrived_ms| at_ms > arrived_ms);
            if at_ms + self.hold_ms > now_ms || waits && at_ms + HELD_BACK_MS > now_ms {
                return;
            }
            let (at_ms, waiting) = first.remove_entry();
            self.state ^= waiting.dropped;
            self.unrecorded ^= waiting.dropped;
            self.record(at_ms, waiting.changed);
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

    fn record(&mut self, at_ms: u64, changed: u32) {
        self.state ^= changed;
        let edges = u64::from(changed.count_ones());
        if !in_force(&self.recording, at_ms) {
            self.edges.stopped += edges;
            self.unrecorded ^= changed;
            return;
        }
        self.edges.recorded += edges;
        let stamp_ms = (in_force(&self.clock, at_ms) + signed(at_ms)).rem_euclid(CENTURY_MS);
        let unrecorded = std::mem::take(&mut self.unrecorded);
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
    pub fn set_clock(&mut self, at_ms: u64, time: TimeStamp) {
        if let Some(time_ms) = stamp_ms(time) {
            set(&mut self.clock, at_ms, time_ms - signed(at_ms));
        }
    }

    /// Recording was started or stopped in this millisecond, after its sample.
    pub fn set_recording(&mut self, at_ms: u64, recording: bool) {
        set(&mut self.recording, at_ms, recording);
    }

    /// The time that the clock shows.
    #[must_use]
    pub fn time_ms(&self, now_ms: u64) -> i64 {
        let ahead_ms = self.clock.last().map_or(0, |&(_, ahead_ms)| ahead_ms);
        (ahead_ms + signed(now_ms)).rem_euclid(CENTURY_MS)
    }

    /// A command has arrived that waits for its turn. What it changes is done by `until_ms`, or
    /// never.
    pub fn command_arrived(&mut self, port: Port, command: &Command, until_ms: u64) {
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
                self.forget_configuration(port);
                self.due.push_back((
                    port,
                    until_ms,
                    Due::Size { to: configure.size, doubtful: false },
                ));
                self.note_overwritten();
            }
            _ => {}
        }
    }

    /// A command has arrived and been carried out at once.
    pub fn command_done(&mut self, command: &Command) {
        match command {
            Command::Erase => {
                self.erases.push(Erase { from: self.len(), to: self.len(), certain: true });
            }
            Command::Configure(configure) => {
                self.forget_configuration(Port::Bus);
                if let Some(size) = configure.size {
                    self.size = size;
                    self.doubt_answers(|_| true);
                }
                self.note_overwritten();
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
            _ => {}
        }
        Ok(())
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
        let Some(from) = self.may_count_from().find(|&from| counts_from(from)) else {
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
    /// have been. Erases are not done in the order in which they arrive, because each port has its
    /// own queue.
    fn may_count_from(&self) -> impl Iterator<Item = usize> {
        let certain = self.erases.iter().filter(|erase| erase.certain);
        let earliest = certain.map(|erase| erase.from).max().unwrap_or(0);
        let len = self.len();
        let erases = self.erases.iter().copied().chain([Erase::POWER_UP]);
        erases.flat_map(move |erase| erase.from.max(earliest)..=erase.to.min(len))
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

fn signed(ms: u64) -> i64 {
    i64::try_from(ms).unwrap_or(i64::MAX)
}
