//! Takes records one by one, from many sources, in any order.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use super::gaps::{self, ToldGaps};
use super::join::{self, Segment};
use super::left_out::LeftOut;
use super::names::{self, TwoNames};
use super::{Held, History, LifeHistory, RecorderHistory};
use crate::record::{
    ClockObservation, ClockStep, EntryRecord, Gap, Life, LifeRecord, PointRecord, Record,
    RecorderRecord, Suppressed, Watched, Why,
};
use crate::site::{ClockRule, Delays, Recorder, Site};

/// Collects the records of all sources.
///
/// A source is one reading or one file. Entries whose life has no name belong together only within
/// a source, so say where the next one [begins](Self::begin_source).
#[derive(Clone, Debug, Default)]
pub struct Collector {
    recorders: Vec<Collected>,
    /// Where each is in that list.
    by_name: BTreeMap<String, usize>,
    /// Where the recorder of the last record is.
    current: usize,
}

/// What was collected of one recorder.
#[derive(Clone, Debug, Default)]
struct Collected {
    name: String,
    lives: BTreeMap<Life, Vec<Held>>,
    /// Readings that do not know their life.
    unnamed: Vec<Segment>,
    /// Whether the next entry without a life begins another one of these.
    begins_segment: bool,
    life_records: Vec<LifeRecord>,
    gaps: Vec<Gap>,
    observations: Vec<ClockObservation>,
    steps: Vec<ClockStep>,
    watched: Vec<Watched>,
    suppressed: Vec<Suppressed>,
    reach: Reach,
    points: BTreeSet<PointRecord>,
    stamps: Option<RecorderRecord>,
    left_out: LeftOut,
}

/// Whether the recorder was read.
#[derive(Clone, Copy, Debug, Default)]
struct Reach {
    /// What the current source says: that it was not reached, and that it was read.
    missed_here: bool,
    read_here: bool,
    /// Whether a source could not reach it.
    missed: bool,
    /// Whether another source has read it.
    read: bool,
}

impl Reach {
    /// Says that another source comes.
    fn end_source(&mut self) {
        match (self.missed_here, self.read_here) {
            (true, _) => self.missed = true,
            (false, read) => self.read |= read,
        }
        (self.missed_here, self.read_here) = (false, false);
    }
}

impl Collector {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Collector {
        Collector::default()
    }

    /// Says that what follows is from another source.
    pub fn begin_source(&mut self) {
        for collected in &mut self.recorders {
            collected.begins_segment = true;
            collected.reach.end_source();
        }
    }

    /// Takes a record of the recorder of this name. Commands are passed over: they tell nothing of
    /// a log or a clock that other records do not tell, and may be of a bus instead of a recorder.
    pub fn add(&mut self, recorder: &str, record: &Record) {
        if matches!(record, Record::Command(_)) {
            return;
        }
        self.turn_to(recorder);
        if let Some(collected) = self.recorders.get_mut(self.current) {
            collected.add(record);
        }
    }

    /// Says that a source has entries of a life between these two sequences, which were left out
    /// because nobody asked for them. They are not missing.
    pub fn leave_out(&mut self, recorder: &str, life: Life, after: u64, before: u64) {
        self.turn_to(recorder);
        if let Some(collected) = self.recorders.get_mut(self.current) {
            collected.left_out.add(life, after, before);
        }
    }

    /// Takes everything of another collector, whose sources are other ones.
    pub fn merge(&mut self, other: Collector) {
        for other in other.recorders {
            self.turn_to(&other.name);
            if let Some(collected) = self.recorders.get_mut(self.current) {
                collected.merge(other);
            }
        }
    }

    /// Adds to a site what files say of recorders and inputs that it does not name. Returns inputs
    /// that files name differently.
    pub fn name_inputs(&self, site: &mut Site) -> Vec<TwoNames> {
        let mut told: Vec<&Collected> =
            self.recorders.iter().filter(|collected| !collected.points.is_empty()).collect();
        told.sort_by(|one, other| one.name.cmp(&other.name));
        told.into_iter()
            .flat_map(|collected| names::add_to(site, &collected.name, &collected.points))
            .collect()
    }

    /// Puts everything together. Recorders of the site of which nothing was collected are there,
    /// too, without a life.
    #[must_use]
    pub fn finish(mut self, site: &Site) -> History {
        for recorder in &site.recorders {
            self.turn_to(&recorder.name);
        }
        self.recorders.sort_by(|one, other| one.name.cmp(&other.name));
        let recorders = self.recorders.into_iter().map(|collected| collected.finish(site));
        History { recorders: recorders.collect() }
    }

    /// Makes the recorder of this name the current one. Most records follow one of the same
    /// recorder, so that is asked first.
    fn turn_to(&mut self, name: &str) {
        if self.recorders.get(self.current).is_some_and(|current| current.name == name) {
            return;
        }
        self.current = match self.by_name.get(name) {
            Some(&known) => known,
            None => {
                let place = self.recorders.len();
                self.by_name.insert(name.to_owned(), place);
                self.recorders.push(Collected { name: name.to_owned(), ..Collected::default() });
                place
            }
        };
    }
}

impl Collected {
    fn add(&mut self, record: &Record) {
        match *record {
            Record::Entry(ref entry) => {
                self.reach.read_here = true;
                self.add_entry(entry);
            }
            Record::Gap(Gap { after: None, why: Why::NotReached, .. }) => {
                self.reach.missed_here = true;
            }
            Record::Gap(gap) => self.gaps.push(gap),
            Record::Clock(observation) => self.observations.push(observation),
            Record::Step(step) => self.steps.push(step),
            Record::Life(life) => self.life_records.push(life),
            Record::Watched(watched) => {
                self.reach.read_here = true;
                self.watched.push(watched);
            }
            Record::Suppressed(ref look) => self.suppressed.push(look.clone()),
            Record::Point(ref point) => _ = self.points.insert(point.clone()),
            Record::Recorder(stamps) => self.stamps = self.stamps.max(Some(stamps)),
            // None of them says anything of the log or its clock.
            Record::Command(_) | Record::Note(_) | Record::Site(_) => {}
        }
    }

    /// Takes everything that was collected of the same recorder elsewhere.
    fn merge(&mut self, mut other: Collected) {
        self.reach.end_source();
        other.reach.end_source();
        self.reach.missed |= other.reach.missed;
        self.reach.read |= other.reach.read;
        for (life, entries) in other.lives {
            match self.lives.entry(life) {
                // Usually a life is in one place, and is not copied.
                Entry::Vacant(vacant) => _ = vacant.insert(entries),
                Entry::Occupied(mut known) => known.get_mut().extend(entries),
            }
        }
        self.unnamed.extend(other.unnamed);
        self.begins_segment = true;
        self.life_records.extend(other.life_records);
        self.gaps.extend(other.gaps);
        self.observations.extend(other.observations);
        self.steps.extend(other.steps);
        self.watched.extend(other.watched);
        self.suppressed.extend(other.suppressed);
        self.points.extend(other.points);
        self.stamps = self.stamps.max(other.stamps);
        self.left_out.merge(other.left_out);
    }

    fn add_entry(&mut self, record: &EntryRecord) {
        let EntryRecord { life, sequence, number, entry, known } = *record;
        match sequence {
            Some(sequence) if life.is_known() => {
                self.lives.entry(life).or_default().push(Held { sequence, entry, number, known });
            }
            _ => self.add_unnamed(sequence, number, record),
        }
    }

    fn add_unnamed(&mut self, sequence: Option<u64>, number: u16, record: &EntryRecord) {
        let EntryRecord { entry, known, .. } = *record;
        let is_by_number = sequence.is_none();
        let continues = |segment: &&mut Segment| {
            let last = segment.entries.last().map_or(0, |held| held.sequence);
            segment.is_by_number == is_by_number && sequence.is_none_or(|sequence| sequence > last)
        };
        let last = match self.begins_segment {
            true => None,
            false => self.unnamed.last_mut().filter(continues),
        };
        self.begins_segment = false;
        match last {
            Some(segment) => {
                let next = segment.entries.last().map_or(1, |held| held.sequence + 1);
                let sequence = sequence.unwrap_or(next);
                segment.entries.push(Held { sequence, entry, number, known });
            }
            None => {
                let sequence = sequence.unwrap_or(1);
                let entries = vec![Held { sequence, entry, number, known }];
                self.unnamed.push(Segment { entries, is_by_number });
            }
        }
    }

    fn finish(mut self, site: &Site) -> RecorderHistory {
        let id = site.recorder(&self.name);
        let described = id.and_then(|id| site.recorders.get(id.0)).cloned();
        let mut conflicts = Vec::new();
        let unnamed = std::mem::take(&mut self.unnamed);
        let named = std::mem::take(&mut self.lives);
        let mut lives = join::lives(named, unnamed, &mut conflicts);
        self.life_records.sort_unstable_by_key(|record| record.life);
        for life in &mut lives {
            self.describe(life);
        }
        let told = ToldGaps::new(self.gaps);
        for life in &mut lives {
            life.left_out = self.left_out.places(life);
            life.gaps = gaps::of_life(life, &told, self.stamps.is_some());
        }
        conflicts.sort_unstable_by_key(|conflict| (conflict.life, conflict.sequence));
        self.reach.end_source();
        let mut recorder = described.unwrap_or_else(|| Recorder::named(&self.name));
        if let Some(stamps) = self.stamps {
            recorder.clock = ClockRule::Offset(stamps.utc_offset_s);
            // The list of another device knows nothing of our input circuits. Whoever knows that
            // device's own delays says them in the site file.
            if recorder.delays == Delays::default() {
                recorder.delays = Delays::NONE;
            }
        }
        RecorderHistory {
            recorder,
            site: id,
            lives,
            observations: sorted(self.observations),
            steps: sorted(self.steps),
            watched: sorted(self.watched),
            suppressed: sorted(self.suppressed),
            is_not_reached: self.reach.missed && !self.reach.read,
            points: self.points.into_iter().collect(),
            stamps: self.stamps,
            conflicts,
        }
    }

    /// Adds what the life records say.
    fn describe(&self, life: &mut LifeHistory) {
        let records = self.life_records.iter().filter(|record| Some(record.life) == life.life);
        for record in records {
            life.is_exact |= record.is_exact;
            life.erased = life.erased.max(record.erased);
        }
    }
}

/// In an order that depends on nothing but the content, each once.
fn sorted<T: std::fmt::Debug + PartialEq>(records: Vec<T>) -> Vec<T> {
    let mut keyed: Vec<(String, T)> =
        records.into_iter().map(|record| (format!("{record:?}"), record)).collect();
    keyed.sort_by(|one, other| one.0.cmp(&other.0));
    keyed.dedup_by(|one, other| one.1 == other.1);
    keyed.into_iter().map(|(_, record)| record).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Boot, CommandRecord, HostReading, Outcome};
    use crate::time::Moment;

    #[test]
    fn a_command_is_no_news_of_a_recorder_and_a_bus_becomes_none() {
        let at = HostReading {
            boot: Boot(1),
            monotonic: Moment::from_us(1),
            utc: Moment::from_us(1),
            utc_doubt_us: None,
        };
        let text = || "a text".to_owned();
        let command = CommandRecord {
            at,
            user: text(),
            host: text(),
            program: text(),
            peer: text(),
            command: text(),
            outcome: Outcome::Sent,
        };
        let mut collector = Collector::new();
        collector.add("geni:/dev/shm/host", &Record::Command(command.clone()));
        assert!(collector.finish(&Site::unknown()).recorders.is_empty());
        let mut collector = Collector::new();
        collector.add("U1", &Record::Gap(Gap::NOT_REACHED));
        collector.add("U1", &Record::Command(command));
        assert!(collector.finish(&Site::unknown()).recorders[0].is_not_reached);
    }
}
