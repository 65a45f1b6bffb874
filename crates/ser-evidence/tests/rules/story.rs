//! What is told of a world: the site and the records, in several sources and in any order.

use std::fmt;

use ser_evidence::record::{ClockObservation, How, Record, Reference, Told};
use ser_evidence::site::{HandObservation, RecorderId, Shift};
use ser_evidence::time::Moment;
use ser_proto::Inputs;

use crate::chance::Chance;
use crate::observing::{Observed, observe};
use crate::operation::Operation;
use crate::readings::{Collector, read_without_memory};
use crate::recorder::TrueRecorder;
use crate::true_time::{MS, Ps, S, ceil_us, floor_us};
use crate::world::{Trouble, World};

/// A world and what is told of it.
pub(crate) struct Story {
    pub(crate) world: World,
    /// The records, by source. Neither sources nor records are in an order.
    pub(crate) sources: Vec<Vec<Told>>,
    /// What was observed of clocks, before anything was made wrong on purpose.
    pub(crate) observed: Vec<Observed>,
    /// What was made wrong on purpose, if anything.
    pub(crate) planted: Option<Told>,
}

impl Story {
    /// The story of a seed.
    pub(crate) fn of(seed: u64) -> Story {
        let mut chance = Chance::new(seed);
        let mut world = World::draw(seed, &mut chance);
        add_hand_observations(&mut world, &mut chance);
        add_shift(&mut world, &mut Chance::new(!seed));
        let mut story = Story { world, sources: Vec::new(), observed: Vec::new(), planted: None };
        for recorder in 0..story.world.recorders.len() {
            story.read(recorder, &mut chance);
        }
        for operation in 0..story.world.operations.len() {
            story.operate(operation, &mut chance);
        }
        story.plant(&mut chance);
        repeat(&mut story.sources, &mut chance);
        shuffle(&mut story.sources, &mut chance);
        story
    }

    /// All records, one source after the other.
    pub(crate) fn records(&self) -> Vec<Told> {
        self.sources.iter().flatten().cloned().collect()
    }

    /// All readings of one recorder's log.
    fn read(&mut self, recorder: usize, chance: &mut Chance) {
        for _ in 0..chance.between(1, 2) {
            let host = chance.below(self.world.hosts.len());
            let times = times(&self.world.recorders[recorder], self.world.until, chance);
            let (mut records, mut observed) =
                Collector::read_all(&self.world, recorder, host, &times, chance);
            let off_us = self.off_us(recorder);
            records.iter_mut().for_each(|record| mistime(record, off_us));
            observed.iter_mut().for_each(|one| mistime_observation(&mut one.observation, off_us));
            if chance.one_in(4) {
                show_changes_only(&mut records);
            }
            self.tell(recorder, records);
            self.observed.extend(observed);
        }
        for _ in 0..chance.between(0, 2) {
            let at = chance.between(self.world.until / 2, self.world.until);
            let mut records = read_without_memory(&self.world.recorders[recorder], at, chance);
            if chance.one_in(4) {
                show_changes_only(&mut records);
            }
            self.tell(recorder, records);
        }
    }

    fn operate(&mut self, operation: usize, chance: &mut Chance) {
        let operation = self.world.operations[operation].clone();
        for &recorder in &operation.recorders {
            if let Some((mut record, mut observed)) =
                observe(&self.world, recorder, &operation, chance)
            {
                let off_us = self.off_us(recorder);
                mistime(&mut record, off_us);
                if let Some(one) = &mut observed {
                    mistime_observation(&mut one.observation, off_us);
                }
                self.tell(recorder, vec![record]);
                self.observed.extend(observed);
            }
        }
    }

    /// How much later everything is told that was observed of a clock. A shift by hand makes up for it.
    fn off_us(&self, recorder: usize) -> i64 {
        let mut shifts = self.world.site.shifts.iter();
        let shift = shifts.find(|shift| shift.recorder == RecorderId(recorder));
        shift.map_or(0, |shift| -shift.us)
    }

    fn tell(&mut self, recorder: usize, records: Vec<Record>) {
        let recorder = &self.world.recorders[recorder].build.site.name;
        let told = records.into_iter().map(|record| Told { recorder: recorder.clone(), record });
        self.sources.push(told.collect());
    }

    /// Makes one thing wrong on purpose.
    fn plant(&mut self, chance: &mut Chance) {
        self.planted = match self.world.trouble {
            Trouble::WrongObservation => plant_wrong_observation(&mut self.sources, chance),
            Trouble::Conflict => plant_conflict(&mut self.sources, chance),
            Trouble::None | Trouble::SecretSet | Trouble::SecretSetBack => None,
        };
    }
}

/// For who looks for a fault: the truth in milliseconds of the world, then what is told of clocks.
impl fmt::Display for Story {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |at: Ps| at / MS;
        writeln!(
            f,
            "seed {} {:?}: {} ms",
            self.world.seed,
            self.world.trouble,
            ms(self.world.until)
        )?;
        for operation in &self.world.operations {
            let Operation { recorders, what, broadcast, sent, arrivals, received, .. } = operation;
            let arrivals: Vec<_> = arrivals.iter().map(|&at| ms(at)).collect();
            let (sent, received, is_answered) = (ms(*sent), ms(*received), operation.is_answered);
            writeln!(
                f,
                "  {recorders:?} {what:?} {broadcast:?} {sent}..{received} at {arrivals:?} \
                 {is_answered}"
            )?;
        }
        for recorder in &self.world.recorders {
            writeln!(f, "{:?}", recorder.build.site)?;
            for life in &recorder.lives {
                let (began, ended) = (ms(life.began), ms(life.ended));
                writeln!(f, "  life {} {began}..{ended} {:?}", life.name, life.erased)?;
            }
            for entry in &recorder.entries {
                let life = &recorder.lives[entry.life];
                let (sequence, at) = (life.sequence(entry.total), ms(entry.sampled));
                let run = (life.power, entry.shown.setting);
                let told = entry.entry;
                writeln!(f, "    {} {sequence} at {at} in run {run:?}: {told:?}", life.name)?;
            }
            let name = &recorder.build.site.name;
            for told in self.sources.iter().flatten().filter(|told| told.recorder == *name) {
                if matches!(told.record, Record::Clock(_) | Record::Step(_) | Record::Gap(_)) {
                    writeln!(f, "      {:?}", told.record)?;
                }
            }
        }
        Ok(())
    }
}

/// Writes entries as a file has them that shows what changed and no other states.
fn show_changes_only(records: &mut [Record]) {
    for record in records {
        if let Record::Entry(entry) = record {
            entry.known = entry.entry.changed;
            entry.entry.state = Inputs(entry.entry.state.0 & entry.known.0);
        }
    }
}

/// When a collector reads.
fn times(recorder: &TrueRecorder, until: Ps, chance: &mut Chance) -> Vec<Ps> {
    let mut times: Vec<Ps> = (0..chance.between(1, 12)).map(|_| chance.between(0, until)).collect();
    if !chance.one_in(4) {
        // Somebody looks soon after something has happened, and at the end.
        let soon = recorder.entries.iter().map(|entry| entry.sampled + 3 * MS);
        times.extend(soon.step_by(7));
        times.push(until);
    }
    times.sort_unstable();
    times
}

/// A person has looked at clocks that were never set.
fn add_hand_observations(world: &mut World, chance: &mut Chance) {
    for recorder in 0..world.recorders.len() {
        let truth = &world.recorders[recorder];
        let is_steady = truth.lives.len() == 1 && truth.clocks[0].settings.len() == 1;
        if !is_steady
            || !chance.one_in(3)
            || matches!(world.trouble, Trouble::SecretSet | Trouble::SecretSetBack)
        {
            continue;
        }
        let at = chance.between(S, world.until);
        let shown = truth.shown_at(at).expect("it is on");
        let doubt_us = chance.between(500_000, 5_000_000);
        let off_us = chance.between(-doubt_us + 1, doubt_us - 1);
        let seen_us = (floor_us(shown.began) + ceil_us(shown.began)) / 2;
        world.site.observations.push(HandObservation {
            recorder: RecorderId(recorder),
            host_time: Moment::from_us(world.start_utc_us + seen_us + off_us),
            unit_time: Moment::from_us(shown.shown_ms * 1000),
            doubt_us: u64::try_from(doubt_us).expect("positive"),
        });
    }
}

/// Whoever observed one of the recorders had a wrong time, and people know by how much. That is said
/// of one host's time for another's only if hosts agree about how long a second is.
fn add_shift(world: &mut World, chance: &mut Chance) {
    if world.trouble != Trouble::None || !world.are_hosts_true || !chance.one_in(3) {
        return;
    }
    let recorder = RecorderId(chance.below(world.recorders.len()));
    let most = chance.of(&[3000, 250_000, 7_200_000_000]);
    let us = chance.between(-most, most);
    let century = |year: i64| Moment::from_us((year - 1970) * 366 * 86_400 * 1_000_000);
    let why = "the computer's clock was wrong".to_owned();
    let (from, to) = (century(1900), century(2100));
    world.site.shifts.push(Shift { recorder, us, from, to, why });
    for seen in world.site.observations.iter_mut().filter(|seen| seen.recorder == recorder) {
        seen.host_time = seen.host_time.after(-us);
    }
}

/// Tells what was observed of a clock by a time that is off. Nothing of it is shared with others.
fn mistime(record: &mut Record, off_us: i64) {
    match record {
        Record::Clock(observation) => mistime_observation(observation, off_us),
        Record::Step(step) => {
            step.reading.monotonic = step.reading.monotonic.after(off_us);
            step.reading.utc = step.reading.utc.after(off_us);
        }
        _ => {}
    }
}

fn mistime_observation(observation: &mut ClockObservation, off_us: i64) {
    if off_us == 0 {
        return;
    }
    if let Reference::Host { bound, .. } = &mut observation.at {
        *bound = bound.shifted(off_us, off_us);
    }
    observation.how = match observation.how {
        How::Set { .. } => How::Set { broadcast: None },
        How::Mark { .. } => How::Query,
        how => how,
    };
}

/// Moves the bound of one observation so far that the truth is not in it.
fn plant_wrong_observation(sources: &mut [Vec<Told>], chance: &mut Chance) -> Option<Told> {
    let all = sources.iter_mut().flatten();
    let mut all: Vec<&mut Told> =
        all.filter(|told| matches!(told.record, Record::Clock(_))).collect();
    if all.is_empty() {
        return None;
    }
    let at = chance.below(all.len());
    let told = &mut all[at];
    let Record::Clock(observation) = &mut told.record else { return None };
    let Reference::Host { bound, .. } = &mut observation.at else { return None };
    let most = chance.of(&[3000, 100_000, 10_000_000]);
    let more = bound.width_us()? + chance.between(1, most);
    *bound = match chance.one_in(2) {
        true => bound.shifted(more, more),
        false => bound.shifted(-more, -more),
    };
    Some(told.clone())
}

/// Tells one entry again, with other content.
fn plant_conflict(sources: &mut Vec<Vec<Told>>, chance: &mut Chance) -> Option<Told> {
    let is_known =
        |told: &&Told| matches!(&told.record, Record::Entry(entry) if entry.life.is_known());
    let all: Vec<Told> = sources.iter().flatten().filter(is_known).cloned().collect();
    if all.is_empty() {
        return None;
    }
    let mut told = all[chance.below(all.len())].clone();
    let Record::Entry(record) = &mut told.record else { return None };
    if chance.one_in(2) {
        record.entry.time.millisecond = (record.entry.time.millisecond + 1) % 1000;
    } else {
        // Of an input whose state is known in any case.
        let (Inputs(state), Inputs(changed)) = (record.entry.state, record.entry.changed);
        record.entry.state = Inputs(state ^ (changed & changed.wrapping_neg()));
    }
    sources.push(vec![told.clone()]);
    Some(told)
}

/// The same is told twice now and then.
fn repeat(sources: &mut Vec<Vec<Told>>, chance: &mut Chance) {
    let mut again: Vec<Told> = sources.iter().flatten().cloned().collect();
    again.retain(|told| !is_without_life(told) && chance.one_in(10));
    sources.push(again);
}

/// The same sources in another order, and their records, too. Only readings without a life stay as
/// they are: their order is all that says what belongs together.
pub(crate) fn shuffle(sources: &mut [Vec<Told>], chance: &mut Chance) {
    chance.shuffle(sources);
    for source in sources {
        if !source.iter().any(is_without_life) {
            chance.shuffle(source);
        }
    }
}

fn is_without_life(told: &Told) -> bool {
    matches!(&told.record, Record::Entry(entry) if !entry.life.is_known())
}
