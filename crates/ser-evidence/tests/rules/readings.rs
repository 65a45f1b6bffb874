//! Readings of logs: by collectors that remember where they were, and by people who do not.

use ser_evidence::record::{
    ClockObservation, EntryRecord, Gap, How, Life, LifeRecord, Lost, Place, Record, Reference,
    Watched, Why,
};
use ser_evidence::time::Moment;
use ser_proto::Inputs;

use crate::chance::Chance;
use crate::observing::Observed;
use crate::recorder::{TrueEntry, TrueLife, TrueRecorder};
use crate::true_time::{MS, Ps, US};
use crate::world::World;

/// A collector of one recorder's entries.
pub(crate) struct Collector<'w> {
    world: &'w World,
    index: usize,
    recorder: &'w TrueRecorder,
    host: usize,
    /// Where it was, and when.
    at: Option<(usize, u64, Ps)>,
    told: Vec<Record>,
    observed: Vec<Observed>,
}

impl<'w> Collector<'w> {
    /// All records of a collector that reads at these times.
    pub(crate) fn read_all(
        world: &'w World,
        index: usize,
        host: usize,
        times: &[Ps],
        chance: &mut Chance,
    ) -> (Vec<Record>, Vec<Observed>) {
        let recorder = &world.recorders[index];
        let (told, observed) = (Vec::new(), Vec::new());
        let mut collector = Collector { world, index, recorder, host, at: None, told, observed };
        for &time in times {
            collector.read(time, chance);
        }
        (collector.told, collector.observed)
    }

    fn read(&mut self, time: Ps, chance: &mut Chance) {
        let Some(life) = self.recorder.life_at(time) else { return };
        let total = self.recorder.total_at(life, time);
        let first = self.recorder.lives[life].first_total;
        let previous = self.at.filter(|&(known, ..)| known == life);
        if let (Some((old, cursor, _)), None) = (self.at, previous) {
            self.tell_new_life(old, cursor);
        }
        self.tell_life(life, chance);
        let cursor = previous.map_or(first, |(_, cursor, _)| cursor);
        self.tell_entries(life, cursor, total);
        if let Some((_, cursor, since)) = previous {
            self.tell_watched(life, since, time, total, chance);
            if total > cursor && chance.one_in(3) {
                self.tell_event(life, cursor + 1, since, time, chance);
            }
        }
        self.at = Some((life, total, time));
    }

    fn tell_new_life(&mut self, old: usize, cursor: u64) {
        let old = &self.recorder.lives[old];
        self.told.push(Record::Gap(Gap {
            life: old.name,
            after: Some(old.sequence(cursor)),
            lost: Lost::Unknown,
            why: Why::LogBeganAnew,
        }));
    }

    fn tell_life(&mut self, life: usize, chance: &mut Chance) {
        let build = &self.recorder.build;
        let life = &self.recorder.lives[life];
        self.told.push(Record::Life(LifeRecord {
            life: life.name,
            is_exact: life.is_exact(),
            model: chance.one_in(2).then_some(build.model),
            size: chance.one_in(2).then_some(build.size),
            erased: life.erased.map(|erased| self.recorder.lives[erased].name),
        }));
    }

    /// Entries after `cursor` up to `total`, as far as they are still in the ring.
    fn tell_entries(&mut self, life: usize, cursor: u64, total: u64) {
        let size = u64::from(self.recorder.build.size);
        let true_life = &self.recorder.lives[life];
        let first = (cursor + 1).max(total.saturating_sub(size) + 1);
        if first > cursor + 1 {
            self.told.push(Record::Gap(Gap {
                life: true_life.name,
                after: Some(true_life.sequence(cursor)),
                lost: Lost::Exactly(u32::try_from(first - cursor - 1).expect("few")),
                why: Why::Overwritten,
            }));
        }
        for sequence in first..=total {
            let entry = self.recorder.entry(life, sequence).expect("it is in the ring");
            let state_before = self.recorder.entry(life, sequence - 1).map(|e| e.entry.state);
            self.tell_not_recorded(true_life, entry, state_before);
            self.told.push(Record::Entry(EntryRecord {
                life: true_life.name,
                sequence: Some(true_life.sequence(sequence)),
                number: number(sequence, self.recorder.build.size),
                entry: entry.entry,
                known: EntryRecord::ALL_KNOWN,
            }));
        }
    }

    fn tell_not_recorded(&mut self, life: &TrueLife, entry: &TrueEntry, before: Option<Inputs>) {
        let Some(before) = before else { return };
        let inputs = before.0 ^ entry.entry.changed.0 ^ entry.entry.state.0;
        if inputs != 0 {
            self.told.push(Record::Gap(Gap {
                life: life.name,
                after: Some(life.sequence(entry.total - 1)),
                lost: Lost::Unknown,
                why: Why::NotRecorded(inputs),
            }));
        }
    }

    fn tell_watched(&mut self, life: usize, from: Ps, to: Ps, total: u64, chance: &mut Chance) {
        let host = &self.world.hosts[self.host];
        let life = &self.recorder.lives[life];
        self.told.push(Record::Watched(Watched {
            life: life.name,
            from: host.reading(from, chance),
            to: host.reading(to, chance),
            through: life.sequence(total),
        }));
    }

    /// The entry with this total was not there at `since` and is there now.
    fn tell_event(&mut self, life: usize, total: u64, since: Ps, now: Ps, chance: &mut Chance) {
        // The entry may have been overwritten: then its stamp is not known.
        let newest = self.recorder.total_at(life, now);
        if newest - total >= u64::from(self.recorder.build.size) {
            return;
        }
        let entry = self.recorder.entry(life, total).expect("it is in the ring");
        let host = &self.world.hosts[self.host];
        let sequence = self.recorder.lives[life].sequence(total);
        let observation = ClockObservation {
            how: How::Event,
            shown: Moment::from_us(entry.shown.shown_ms * 1000),
            // The millisecond that is shown began up to a millisecond before the sample.
            at: Reference::Host {
                bound: host.bound(since - MS - US, now),
                reading: host.reading(now, chance),
            },
            place: Place {
                life: self.recorder.lives[life].name,
                after: Some(sequence),
                before: Some(sequence),
                newest: Some(entry.entry),
                fellow: None,
            },
        };
        self.told.push(Record::Clock(observation));
        self.observed.push(Observed {
            recorder: self.index,
            observation,
            life,
            totals: (total, total),
            shown: entry.shown,
        });
    }
}

/// A reading without memory: what is in the ring, or the newest few of it.
pub(crate) fn read_without_memory(
    recorder: &TrueRecorder,
    time: Ps,
    chance: &mut Chance,
) -> Vec<Record> {
    let Some(life) = recorder.life_at(time) else { return Vec::new() };
    let total = recorder.total_at(life, time);
    let in_ring = (total - recorder.lives[life].first_total).min(recorder.build.size.into());
    if in_ring == 0 {
        return Vec::new();
    }
    let wanted = i64::try_from(in_ring).expect("few");
    let count = u64::try_from(chance.between(1, wanted)).expect("positive");
    // Sequences are known modulo 65536, and the first that is read is above 0.
    let mut newest = total % 65_536;
    if newest < count {
        newest += 65_536;
    }
    let by_number = chance.one_in(4);
    let record = |back: u64| {
        let entry = recorder.entry(life, total - back).expect("it is in the ring");
        Record::Entry(EntryRecord {
            life: Life::UNKNOWN,
            sequence: (!by_number).then_some(newest - back),
            number: number(entry.total, recorder.build.size),
            entry: entry.entry,
            known: EntryRecord::ALL_KNOWN,
        })
    };
    (0..count).rev().map(record).collect()
}

/// The number of an entry in its ring.
fn number(total: u64, size: u16) -> u16 {
    u16::try_from((total - 1) % u64::from(size) + 1).expect("at most the size")
}
