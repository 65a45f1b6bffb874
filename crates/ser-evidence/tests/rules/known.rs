//! What a reader of the records can know for certain: which entries and observations are of one run
//! of a clock. It is less than the crate may know, and takes no reckoning with times.

use ser_evidence::record::{Life, Place, Record, Reference};

use crate::judge::{Judge, Judged};
use crate::observing::Observed;
use crate::recorder::TrueRecorder;

/// How long before or after an observation it is asked for its worth.
const NEAR_MS: i64 = 600_000;

/// Where a clock may have been set, if this tells of that.
fn place_of_step(record: &Record) -> Option<Place> {
    match record {
        Record::Clock(observation) if observation.how.is_set() => Some(observation.place),
        Record::Step(step) => Some(step.place),
        _ => None,
    }
}

/// What a reader of the records can know for certain about runs.
pub(crate) struct Known<'a> {
    observed: &'a [Observed],
    /// For each recorder, where its clock may have been set.
    steps: Vec<Vec<Record>>,
    /// For each recorder, the names of its lives.
    lives: Vec<Vec<Life>>,
    /// For each recorder and life, how much less than totals sequences are.
    less: Vec<Vec<u64>>,
}

impl<'a> Known<'a> {
    pub(crate) fn of(judge: &Judge<'a>) -> Known<'a> {
        let world = &judge.story.world;
        let mut steps = vec![Vec::new(); world.recorders.len()];
        for told in judge.story.sources.iter().flatten() {
            let recorder = world.site.recorder(&told.recorder).expect("in the site").0;
            if place_of_step(&told.record).is_some() && !steps[recorder].contains(&told.record) {
                steps[recorder].push(told.record.clone());
            }
        }
        let lives = |recorder: &TrueRecorder| recorder.lives.iter().map(|life| life.name).collect();
        let less =
            |recorder: &TrueRecorder| recorder.lives.iter().map(|life| life.told_less).collect();
        Known {
            observed: &judge.story.observed,
            steps,
            lives: world.recorders.iter().map(lives).collect(),
            less: world.recorders.iter().map(less).collect(),
        }
    }

    /// The observations near an entry that are of the same run for certain.
    pub(crate) fn observed_in_run_of(&self, judged: Judged<'a>) -> Vec<&'a Observed> {
        let is_of_run = |observed: &&Observed| {
            let place = observed.observation.place;
            let is_well_told =
                place.life.is_known() && place.after.is_some() && place.before.is_some();
            let ms = judged.truth.shown.shown_ms - observed.shown.shown_ms;
            let is_set = observed.observation.how.is_set();
            is_well_told
                && judged.row.life == place.life
                && observed.recorder == judged.row.recorder
                && observed.shown.setting == judged.truth.shown.setting
                && ms.abs() <= NEAR_MS
                && (!is_set || judged.truth.total > observed.totals.1)
                && self.is_steady(
                    (observed.recorder, observed.life),
                    entry(judged.truth.total),
                    observed.totals,
                    is_set.then_some(observed),
                )
        };
        self.observed.iter().filter(is_of_run).collect()
    }

    pub(crate) fn is_one_run(&self, one: Judged<'a>, other: Judged<'a>) -> bool {
        let is_one_life = one.row.life.is_known()
            && (one.row.recorder, one.row.life) == (other.row.recorder, other.row.life);
        let settings = [one, other].map(|judged| judged.truth.shown.setting);
        let life = (one.row.recorder, one.truth.life);
        let places = [one, other].map(|judged| entry(judged.truth.total));
        is_one_life
            && settings[0] == settings[1]
            && self.is_steady(life, places[0], places[1], None)
    }

    /// The observations of a clock that are of the same run for certain. None of them set it.
    pub(crate) fn observed_in_run_of_another(&self, one: &Observed) -> Vec<&'a Observed> {
        let is_plain = |observed: &Observed| {
            let place = observed.observation.place;
            let is_told = place.life.is_known() && place.after.is_some() && place.before.is_some();
            is_told && !observed.observation.how.is_set()
        };
        let is_of_run = |other: &&Observed| {
            let run = |of: &Observed| (of.recorder, of.life, of.shown.setting);
            is_plain(other)
                && run(one) == run(other)
                && self.is_steady((one.recorder, one.life), one.totals, other.totals, None)
        };
        let all = self.observed.iter().filter(|_| is_plain(one));
        all.filter(is_of_run).collect()
    }

    /// Whether certainly no step is between two places of a life, apart from the step of which the
    /// second one is the place.
    fn is_steady(
        &self,
        (recorder, life): (usize, usize),
        one: (u64, u64),
        other: (u64, u64),
        own: Option<&Observed>,
    ) -> bool {
        let less = self.less[recorder][life];
        let life = self.lives[recorder][life];
        let own = own.map(|observed| Record::Clock(observed.observation));
        let range = |step: &Place| {
            let from = step.after.map_or(0, |sequence| sequence + less);
            (from, step.before.map_or(u64::MAX, |sequence| sequence + less))
        };
        let mut over: Vec<&Record> = Vec::new();
        for record in &self.steps[recorder] {
            let step = place_of_step(record).expect("a step");
            let is_own = Some(record) == own.as_ref();
            if step.life != life && step.life.is_known() {
                continue;
            }
            let (from, to) = range(&step);
            let is_before_both = to < one.0 && (to < other.0 || is_own);
            let is_after_both = from > one.1 && from > other.1;
            if step.life != life || !is_before_both && !is_after_both {
                return false;
            }
            let meets = |other: &&&Record| {
                let (other_from, other_to) = range(&place_of_step(other).expect("a step"));
                from <= other_to && other_from <= to
            };
            // Nobody knows which of the two was the last.
            if is_before_both && over.iter().filter(meets).any(|other| !are_ordered(record, other))
            {
                return false;
            }
            if is_before_both {
                over.push(record);
            }
        }
        true
    }
}

/// The place of an entry as that of an observation is told: after one total, before the other.
fn entry(total: u64) -> (u64, u64) {
    (total, total - 1)
}

/// Whether one host alone knows which of two sets of a clock came first.
fn are_ordered(one: &Record, other: &Record) -> bool {
    let (Record::Clock(one), Record::Clock(other)) = (one, other) else { return false };
    match (one.at, other.at) {
        (
            Reference::Host { bound, reading },
            Reference::Host { bound: other_bound, reading: other_reading },
        ) => {
            reading.boot == other_reading.boot
                && (bound.is_before(other_bound) || other_bound.is_before(bound))
        }
        _ => false,
    }
}
