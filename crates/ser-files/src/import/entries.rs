//! From rows in UTC to records of our recorders.
//!
//! A list becomes one life, whose name is made from its content: the same file read twice is the same
//! life. Each row is an entry of its own, so rows of one millisecond keep their order. A list shows
//! changes only, so an entry knows what the list has shown since the last hole.

use std::collections::BTreeMap;

use ser_evidence::record::{
    ClockObservation, EntryRecord, Gap, How, Life, LifeRecord, Lost, Place as LogPlace,
    PointRecord, Record, RecorderRecord, Reference, Why,
};
use ser_evidence::time::{Bound, Moment, stamp};
use ser_proto::{Entry, Inputs as Bits, TimeStamp};
use sha2::{Digest, Sha256};

use super::inputs::Inputs;
use super::list::{Texts, To};
use super::notes::Notes;
use super::states::{Meanings, NoState};
use super::timed::{Timed, TimedRow};
use super::zone::Doubt;

/// A record of a recorder, and what people should know of it.
pub(super) struct Made {
    pub(super) recorder: usize,
    pub(super) record: Record,
    /// The line of the row that it is from, where there is a note.
    pub(super) line: Option<u64>,
    pub(super) note: Option<String>,
}

/// How long a time between two rows deserves a new look at the clock, in milliseconds.
const QUIET_MS: i64 = 10_000;

/// Records of looks at the clock of one list that are written at most.
const MOST_LOOKS: usize = 100_000;

/// What is needed to make records.
pub(super) struct Maker<'a> {
    pub(super) points: &'a Texts,
    pub(super) words: &'a Texts,
    pub(super) inputs: &'a Inputs,
    pub(super) meanings: &'a Meanings,
    /// How far the clock may be from UTC, if the user says it.
    pub(super) doubt_ms: Option<u32>,
}

impl Maker<'_> {
    /// What is known of the recorders themselves.
    pub(super) fn recorders(&self) -> Vec<Made> {
        let mut made = Vec::new();
        for recorder in 0..self.inputs.recorders.len() {
            let record = Record::Recorder(RecorderRecord::UTC);
            made.push(Made { recorder, record, line: None, note: None });
            for (input, point) in self.inputs.points(recorder) {
                let name = self.points.get(point).to_owned();
                let [on, off] = self.meanings.texts(point);
                let record = Record::Point(PointRecord { input, name, on, off });
                made.push(Made { recorder, record, line: None, note: None });
            }
        }
        made
    }

    /// The records of a list.
    pub(super) fn list(&self, list: &Timed, notes: &mut Notes) -> Vec<Made> {
        let mut life = Writing {
            maker: self,
            life: self.life(list),
            logs: vec![Log::default(); self.inputs.recorders.len()],
            is_split: self.inputs.recorders.len() > 1,
            is_sampled: list.is_sampled,
            made: Vec::new(),
            is_doubtful: list.rows.iter().any(|row| row.doubt.is_some()),
            looked_ms: None,
            looks: 0,
        };
        life.begin(list);
        for row in &list.rows {
            life.row(row, notes);
        }
        if let Some(points) = &list.torn_at_end {
            life.tear(points);
        }
        for recorder in 0..life.logs.len() {
            life.tell_gap(recorder, Why::Unreadable);
        }
        if life.is_doubtful && self.doubt_ms.is_some() {
            notes.remark(
                None,
                "some local times of this list may be an hour off, so --doubt-ms is not used for it",
            );
        }
        life.made
    }

    /// Why the state of a point is not known.
    fn why(&self, point: usize, no_state: NoState) -> String {
        let point = self.points.get(point);
        match no_state {
            NoState::Third(word) => {
                let word = self.words.get(word);
                format!("{point:?} has two states already, and {word:?} is another")
            }
            NoState::Part(word) => format!(
                "{:?} of {point:?} looks like a part of a word; --map can say what it means",
                self.words.get(word)
            ),
            NoState::NoWord => format!("{point:?} has no state here, and has one in other rows"),
        }
    }

    /// A name that the same content has each time.
    fn life(&self, list: &Timed) -> Life {
        let mut digest = Sha256::new();
        let mut add = |text: &str| {
            digest.update(text.len().to_le_bytes());
            digest.update(text.as_bytes());
        };
        for row in &list.rows {
            add(&format!("{} {}", row.place, row.at_ms));
            for change in &row.changes {
                add(self.points.get(change.point));
                add(match change.to {
                    To::State(true) => "on",
                    To::State(false) => "off",
                    To::Word(word) => self.words.get(word),
                    To::Event => "event",
                    To::Unseen => "changed",
                });
            }
        }
        let digest = digest.finalize();
        let bits = digest.first_chunk().map_or(1, |bytes| u64::from_be_bytes(*bytes));
        Life::from_bits(bits.max(1))
    }
}

/// What a recorder has of the life that is being written.
#[derive(Clone, Copy, Debug, Default)]
struct Log {
    sequence: u64,
    /// Missing rows since its last entry.
    missing: u64,
    /// Whether something is lost since its last entry: the inputs that are known to have changed.
    torn: Option<u32>,
    on: u32,
    known: u32,
    is_begun: bool,
    /// When an observation by hand was written last.
    vouched_ms: Option<i64>,
}

/// A life on its way.
struct Writing<'a> {
    maker: &'a Maker<'a>,
    life: Life,
    logs: Vec<Log>,
    is_split: bool,
    is_sampled: bool,
    made: Vec<Made>,
    is_doubtful: bool,
    looked_ms: Option<i64>,
    looks: usize,
}

impl Writing<'_> {
    /// What is known before the first row.
    fn begin(&mut self, list: &Timed) {
        let first = list.rows.first().map_or(1, |row| row.place);
        // Somebody who fetches a part of a log does not get its beginning: only a device that says how
        // much it holds, or a list that begins with the first place, tells what is missing before.
        let tells_all = first == 1 || list.overwritten.is_some();
        let counts = list.counts_from_beginning && tells_all && !self.is_split;
        let record =
            LifeRecord { life: self.life, is_exact: counts, model: None, size: None, erased: None };
        for recorder in 0..self.logs.len() {
            self.tell(recorder, Record::Life(record), None);
        }
        let missing = first - 1;
        if counts && list.overwritten == Some(missing) && missing > 0 {
            let lost = Lost::Exactly(u32::try_from(missing).unwrap_or(u32::MAX));
            let gap = Gap { life: self.life, after: Some(0), lost, why: Why::Overwritten };
            self.tell(0, Record::Gap(gap), None);
        }
        let is_torn = list.rows.first().is_some_and(|row| row.torn.is_some());
        let before = if list.counts_from_beginning || is_torn { 0 } else { missing };
        for log in &mut self.logs {
            log.sequence = before;
            // Recorders of one list count for themselves, and leave out what is lost before the first.
            log.missing = if self.is_split && is_torn { missing } else { 0 };
        }
    }

    fn tell(&mut self, recorder: usize, record: Record, note: Option<(u64, String)>) {
        let (line, note) = note.unzip();
        self.made.push(Made { recorder, record, line, note });
    }

    fn row(&mut self, row: &TimedRow, notes: &mut Notes) {
        let Some(time) = stamp(Moment::from_us(row.at_ms.saturating_mul(1000))) else {
            notes.leave_out(row.line, "no recorder's clock shows this time");
            self.logs.iter_mut().for_each(|log| log.missing += 1);
            self.tear(&[]);
            return;
        };
        if let Some(points) = &row.torn {
            self.tear(points);
        }
        self.learn(row);
        let moved = self.moved(row, notes);
        if moved.is_empty() {
            return;
        }
        self.look(row.at_ms, &moved);
        for (recorder, (changed, on, known)) in moved {
            self.tell_gap(recorder, Why::NotReached);
            let Some(log) = self.logs.get_mut(recorder) else { continue };
            log.sequence = match self.is_split {
                true => log.sequence + 1 + std::mem::take(&mut log.missing),
                false => row.place,
            };
            log.is_begun = true;
            log.on = log.on & !changed | on;
            log.known = log.known & !changed | known;
            let record = EntryRecord {
                life: self.life,
                sequence: Some(log.sequence),
                number: u16::try_from((log.sequence - 1) % 65_535 + 1).unwrap_or(u16::MAX),
                entry: Entry { changed: Bits(changed), state: Bits(log.on & log.known), time },
                known: Bits(log.known),
            };
            let note = note(row, &time).map(|note| (row.line, note));
            self.tell(recorder, Record::Entry(record), note);
        }
        self.doubt(row.at_ms);
    }

    /// Something is lost, in which these points are known to have changed.
    fn tear(&mut self, points: &[usize]) {
        for log in &mut self.logs {
            log.torn.get_or_insert_default();
            // The next sample shows all states again; a list does not.
            log.known = if self.is_sampled { log.known } else { 0 };
        }
        for place in points.iter().filter_map(|point| self.maker.inputs.of_point(*point)) {
            if let Some(log) = self.logs.get_mut(place.recorder) {
                *log.torn.get_or_insert_default() |= 1 << (place.input - 1);
            }
        }
    }

    /// Tells what is lost since the last entry of a recorder. `unknown` says why where nobody knows
    /// whether there was an entry: behind the last one, only a reason of the file's own is a loss.
    fn tell_gap(&mut self, recorder: usize, unknown: Why) {
        let Some(log) = self.logs.get_mut(recorder) else { return };
        let Some(inputs) = log.torn.take() else { return };
        // A row of a list is an entry of somebody; a sample need not be.
        let lost = match self.is_sampled || self.is_split {
            true => Lost::Unknown,
            false => Lost::AtLeast(1),
        };
        let why = match (inputs, lost) {
            (0, Lost::Unknown) => unknown,
            (0, _) => Why::NotReached,
            (inputs, _) => Why::NotRecorded(inputs),
        };
        let gap = Gap { life: self.life, after: Some(log.sequence), lost, why };
        self.tell(recorder, Record::Gap(gap), None);
    }

    /// What is known of states before a row.
    fn learn(&mut self, row: &TimedRow) {
        if row.forgets {
            self.logs.iter_mut().for_each(|log| log.known = 0);
        }
        for (point, is_on) in &row.learnt {
            let Some(place) = self.maker.inputs.of_point(*point) else { continue };
            let Some(log) = self.logs.get_mut(place.recorder) else { continue };
            let bit = 1 << (place.input - 1);
            log.known |= bit;
            log.on = if *is_on { log.on | bit } else { log.on & !bit };
        }
    }

    /// What a row changes, by recorder: inputs, those that are on, those whose state is known.
    fn moved(&mut self, row: &TimedRow, notes: &mut Notes) -> BTreeMap<usize, (u32, u32, u32)> {
        let mut moved: BTreeMap<usize, (u32, u32, u32)> = BTreeMap::new();
        for change in &row.changes {
            let Some(place) = self.maker.inputs.of_point(change.point) else { continue };
            let state = match self.maker.meanings.state(change.point, change.to) {
                Ok(state) => state,
                Err(no_state) => {
                    notes.leave_out(row.line, self.maker.why(change.point, no_state));
                    // Something happened that no entry has.
                    self.logs.iter_mut().for_each(|log| log.missing += 1);
                    self.tear(&[]);
                    continue;
                }
            };
            let bit = 1_u32 << (place.input - 1);
            let (changed, on, known) = moved.entry(place.recorder).or_default();
            *changed |= bit;
            *on |= if state == Some(true) { bit } else { 0 };
            *known |= if state.is_some() { bit } else { 0 };
        }
        moved
    }

    /// Recorders of one list show one clock: now and then they say so to each other.
    fn look(&mut self, at_ms: i64, moved: &BTreeMap<usize, (u32, u32, u32)>) {
        let is_news = self.looked_ms.is_none_or(|before| (at_ms - before).abs() >= QUIET_MS)
            || moved.keys().any(|moved| self.logs.get(*moved).is_some_and(|log| !log.is_begun));
        if !self.is_split || !is_news || self.looks * self.logs.len() >= MOST_LOOKS {
            return;
        }
        self.looked_ms = Some(at_ms);
        self.looks += 1;
        let mut digest = Sha256::new();
        digest.update(self.life.bits().to_le_bytes());
        digest.update(self.looks.to_le_bytes());
        let broadcast =
            digest.finalize().first_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes));
        for recorder in 0..self.logs.len() {
            let how = How::Mark { broadcast };
            self.observe(recorder, how, at_ms, Bound::UNKNOWN);
        }
    }

    /// What the user says of the clock.
    fn doubt(&mut self, at_ms: i64) {
        let Some(doubt_ms) = self.maker.doubt_ms.filter(|_| !self.is_doubtful) else { return };
        let (at_us, doubt_us) = (at_ms * 1000, i64::from(doubt_ms) * 1000);
        let bound = Bound::from_us(at_us - doubt_us, at_us + doubt_us);
        for recorder in 0..self.logs.len() {
            let Some(log) = self.logs.get_mut(recorder) else { continue };
            let is_news = log.is_begun
                && log.vouched_ms.is_none_or(|before| (at_ms - before).abs() >= QUIET_MS);
            if is_news {
                log.vouched_ms = Some(at_ms);
                self.observe(recorder, How::Hand, at_ms, bound);
            }
        }
    }

    fn observe(
        &mut self,
        recorder: usize,
        how: How,
        at_ms: i64,
        bound: Bound<ser_evidence::time::Utc>,
    ) {
        let sequence = self.logs.get(recorder).map(|log| log.sequence);
        let place = LogPlace {
            life: self.life,
            after: sequence,
            before: sequence,
            newest: None,
            fellow: None,
        };
        let shown = Moment::from_us(at_ms.saturating_mul(1000));
        let at = Reference::Utc(bound);
        self.tell(recorder, Record::Clock(ClockObservation { how, shown, at, place }), None);
    }
}

/// What people should know of a row.
fn note(row: &TimedRow, time: &TimeStamp) -> Option<String> {
    match row.doubt? {
        Doubt::Twice(ns) => {
            let minutes = ns / 60_000_000_000;
            Some(format!("{TWICE}: it may also be {minutes} min later than {time} UTC"))
        }
        Doubt::Missing => Some(LEFT_OUT.to_owned()),
    }
}

/// How the remark about a time begins that may be another one.
const TWICE: &str = "this hour came twice";

/// The remark about a local time that no clock showed that follows its zone.
const LEFT_OUT: &str = "this local time was left out when the clocks went forward";

/// Whether the remark of an imported entry says that its time may be another one: its local hour came
/// twice, or was left out.
#[must_use]
pub fn is_doubt_of_time(note: &str) -> bool {
    note.starts_with(TWICE) || note == LEFT_OUT
}
