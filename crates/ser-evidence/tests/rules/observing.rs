//! What is told of clocks, and what was true of it.

use ser_evidence::record::{ClockObservation, ClockStep, How, Life, Place, Record, Reference};
use ser_evidence::time::{Bound, Moment};

use crate::chance::Chance;
use crate::operation::{Operation, What};
use crate::recorder::{SetTakesEffect, TrueRecorder};
use crate::true_clock::TrueShown;
use crate::true_time::{MS, Ps, US};
use crate::world::{Trouble, World};

/// An observation that was told, and the truth of it.
#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// Index of the recorder.
    pub(crate) recorder: usize,
    pub(crate) observation: ClockObservation,
    /// The life, and between which totals of it.
    pub(crate) life: usize,
    pub(crate) totals: (u64, u64),
    /// What was shown in truth, and since when.
    pub(crate) shown: TrueShown,
}

/// What is told of an operation at one recorder: a record, and the truth if it is an observation.
pub(crate) fn observe(
    world: &World,
    recorder: usize,
    operation: &Operation,
    chance: &mut Chance,
) -> Option<(Record, Option<Observed>)> {
    let (life, totals) = totals(&world.recorders[recorder], operation);
    let how = match (operation.what, operation.broadcast) {
        (What::Set(_), broadcast) => How::Set { broadcast },
        (What::Look, Some(broadcast)) => How::Mark { broadcast },
        (What::Look, None) => How::Query,
    };
    let told = place(&world.recorders[recorder], life, totals, how, chance);
    // What nobody can place may be of before a secret set or of after it.
    let place = match world.trouble {
        Trouble::SecretSetBack => {
            let life = &world.recorders[recorder].lives[life];
            let (after, before) = (life.sequence(totals.0), life.sequence(totals.1));
            Place { life: life.name, after: Some(after), before: Some(before), ..told }
        }
        _ => told,
    };
    let host = &world.hosts[operation.host];
    let reading = host.reading(operation.received, chance);
    if !operation.is_answered {
        return how.is_set().then_some((Record::Step(ClockStep { place, reading }), None));
    }
    let shown = shown(&world.recorders[recorder], operation);
    // The millisecond in force at the arrival began up to a millisecond before, the next one will
    // begin up to a millisecond later.
    let (before, after) = match (how.is_set(), world.set_takes_effect) {
        (true, SetTakesEffect::AtNextTick) => (0, MS + US),
        (true, SetTakesEffect::AtOnce) | (false, _) => (MS + US, 0),
    };
    let bound = host.bound(operation.sent - before, operation.received + after);
    let bound = match chance.below(16) {
        0 => Bound::new(bound.lo(), None),
        1 => Bound::new(None, bound.hi()),
        _ => bound,
    };
    let observation = ClockObservation {
        how,
        shown: Moment::from_us(shown.shown_ms * 1000),
        at: Reference::Host { bound, reading },
        place,
    };
    Some((
        Record::Clock(observation),
        Some(Observed { recorder, observation, life, totals, shown }),
    ))
}

/// The life in which an operation was, and the totals that were read before and after.
fn totals(recorder: &TrueRecorder, operation: &Operation) -> (usize, (u64, u64)) {
    let life = recorder.life_at(operation.sent).expect("operations are in one life");
    let total = |at: Ps| recorder.total_at(life, at);
    (life, (total(operation.before), total(operation.after)))
}

/// What the clock showed in truth.
fn shown(recorder: &TrueRecorder, operation: &Operation) -> TrueShown {
    let arrival = operation.instant();
    let What::Set(shown_ms) = operation.what else {
        return recorder.shown_at(arrival).expect("operations are in one life");
    };
    let power = recorder.build.schedule.power_at(arrival).expect("operations are in one life");
    let clock = &recorder.clocks[power];
    let tick = match recorder.build.set_takes_effect {
        SetTakesEffect::AtOnce => clock.ticks.at(arrival),
        SetTakesEffect::AtNextTick => clock.ticks.at(arrival) + 1,
    };
    let is_it =
        |setting: &crate::true_clock::Setting| setting.tick == tick && setting.shown_ms == shown_ms;
    let setting = clock.settings.iter().rposition(is_it).expect("it set the clock");
    TrueShown { shown_ms, began: clock.ticks.instant(tick), setting }
}

/// What is told of the place. Some readers know nothing of lives, some read no totals.
fn place(
    recorder: &TrueRecorder,
    life: usize,
    (after, before): (u64, u64),
    how: How,
    chance: &mut Chance,
) -> Place {
    let newest = recorder.entry(life, after).map(|entry| entry.entry);
    let newest = newest.filter(|_| !chance.one_in(3));
    let life = &recorder.lives[life];
    let (mut after, mut before) = (Some(life.sequence(after)), Some(life.sequence(before)));
    if !how.is_set() && chance.one_in(8) || chance.one_in(40) {
        return Place { life: life.name, after: None, before: None, newest: None, fellow: None };
    }
    match chance.below(12) {
        0 => after = None,
        1 => before = None,
        _ => {}
    }
    let newest = newest.filter(|_| after.is_some());
    if chance.one_in(8) {
        let modulo = |sequence: Option<u64>| sequence.map(|sequence| sequence % 65_536);
        return Place {
            life: Life::UNKNOWN,
            after: modulo(after),
            before: modulo(before),
            newest,
            fellow: None,
        };
    }
    Place { life: life.name, after, before, newest, fellow: None }
}
