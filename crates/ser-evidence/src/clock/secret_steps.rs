//! Where a clock was set without anybody telling, as an observation and an entry show.
//!
//! A clock that shows less at an entry than at an observation before it was set in between; so was
//! one that shows less at an observation than at an entry before it. Stamps alone show such a step
//! only if both sides of it have entries: [`backward_steps`].

use super::hosts::Hosts;
use super::placing::{self, Located, Whereabouts};
use super::runs::{Step, backward_steps, was_set};
use super::when::{When, when};
use crate::history::{Held, LifeHistory, RecorderHistory};
use crate::record::How;
use crate::time::{Bound, Moment, Shown, shown};

/// An observation of a clock in one life.
struct Sight {
    /// The index of the observation.
    number: usize,
    at: Located,
    when: When,
    shown: Moment<Shown>,
    /// Whether it is what the clock was set to.
    is_set: bool,
}

/// A step, and the least that the clock showed after it.
type Secret = (Step, Moment<Shown>);

/// What stamps and observations show in each life beyond the steps that were `told`.
pub(super) fn secret_steps(
    recorder: &RecorderHistory,
    told: &[Vec<Step>],
    hosts: &Hosts,
) -> Vec<Vec<Step>> {
    let mut found: Vec<Vec<Secret>> = vec![Vec::new(); recorder.lives.len()];
    for sight in sights(recorder, hosts) {
        let Some(life) = recorder.lives.get(sight.at.life) else { continue };
        if let Some(found) = found.get_mut(sight.at.life) {
            found.extend(step_behind(life, &sight));
            found.extend(step_ahead(life, &sight));
        }
    }
    found.into_iter().zip(told).map(|(found, told)| untold(found, told)).collect()
}

/// The observations whose place is known on both sides. Where an entry is the observation, its stamp
/// shows what there is to see, and what a person read has no place.
fn sights(recorder: &RecorderHistory, hosts: &Hosts) -> impl Iterator<Item = Sight> {
    let observations = recorder.observations.iter().enumerate();
    observations.filter_map(|(number, observation)| {
        if matches!(observation.how, How::Event | How::Hand) {
            return None;
        }
        let located = placing::locate(recorder, &observation.place);
        let Whereabouts::Here(at @ Located { before, .. }) = located else { return None };
        (before != u64::MAX).then(|| Sight {
            number,
            at,
            when: when(observation.at, hosts),
            shown: observation.shown,
            is_set: observation.how.is_set(),
        })
    })
}

/// The step between an observation and the next entry.
fn step_behind(life: &LifeHistory, sight: &Sight) -> Option<Secret> {
    let behind = life.entries.partition_point(|held| held.sequence <= sight.at.before);
    let (sequence, now) = life.entries.get(behind..)?.iter().find_map(stamp)?;
    let (at, utc) = sight.when;
    let step = Step {
        after: sight.at.after,
        before: sequence - 1,
        at: at.map(|(boot, bound)| (boot, Bound::new(bound.lo(), None))),
        utc: Bound::new(utc.lo(), None),
        follows: Some(sight.number),
        ..Step::SILENT
    };
    was_set(sight.shown, now).then_some((step, now))
}

/// The step between an observation and the entry before it. A clock that was set then needs no
/// other one.
fn step_ahead(life: &LifeHistory, sight: &Sight) -> Option<Secret> {
    let up_to = life.entries.partition_point(|held| held.sequence <= sight.at.after);
    let (sequence, then) = life.entries.get(..up_to)?.iter().rev().find_map(stamp)?;
    // Where entries show it themselves, they say more exactly where it was.
    let behind = life.entries.partition_point(|held| held.sequence <= sight.at.before);
    let around = up_to.saturating_sub(1)..(behind + 1).min(life.entries.len());
    let is_shown = life.entries.get(around).is_some_and(|held| !backward_steps(held).is_empty());
    let (at, utc) = sight.when;
    let step = Step {
        after: sequence,
        before: sight.at.before,
        at: at.map(|(boot, bound)| (boot, Bound::new(None, bound.hi()))),
        utc: Bound::new(None, utc.hi()),
        ..Step::SILENT
    };
    (!sight.is_set && !is_shown && was_set(then, sight.shown)).then_some((step, sight.shown))
}

/// What is left when those are taken away that somebody told of, each step once.
fn untold(mut found: Vec<Secret>, told: &[Step]) -> Vec<Step> {
    // A step that was told may be what shows, unless it was before the observation.
    let is_told = |(secret, shows): &Secret| {
        told.iter().any(|step| step.explains(secret, *shows) && !step.precedes(secret))
    };
    found.retain(|secret| !is_told(secret));
    let mut steps: Vec<Step> = found.into_iter().map(|(step, _)| step).collect();
    // Several observations show one step: the last of those before it says most.
    steps.sort_by_key(|step| {
        let lo = step.at.and_then(|(_, bound)| bound.lo()).map(Moment::us);
        (step.before, lo, step.after, step.follows)
    });
    steps.dedup_by(|later, kept| {
        let is_one =
            later.before == kept.before && later.follows.is_some() == kept.follows.is_some();
        if is_one {
            *kept = *later;
        }
        is_one
    });
    steps
}

fn stamp(held: &Held) -> Option<(u64, Moment<Shown>)> {
    Some((held.sequence, shown(&held.entry.time)?))
}
