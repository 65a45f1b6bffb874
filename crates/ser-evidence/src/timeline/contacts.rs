//! Contacts that are wired to two recorders.
//!
//! Both recorders see the same movement. Where it is certain which change of one is which of the
//! other, the two clocks bound each other. A change without its partner is told: a wire, an input
//! or a clock is not as the site file has it.

use std::collections::BTreeMap;

use super::watching::{Side, reaches, stands_alone, was_watching};
use super::{ChangeId, EventId, Timeline, event_id};
use crate::clock::LinkReason;
use crate::clock::links::Link;
use crate::site::{Point, PointId};
use crate::time::shown;

/// Changes whose times are less certain than this are not paired, in microseconds.
const WIDEST_US: i64 = 60_000_000;

/// A contact that two recorders should have seen alike, and have not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ContactFinding {
    /// The change that has no partner.
    pub change: ChangeId,
    /// Its point.
    pub point: PointId,
    /// The same contact on the other recorder.
    pub other: PointId,
    /// What is wrong.
    pub trouble: ContactTrouble,
}

/// What is wrong with a contact that is wired to two recorders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactTrouble {
    /// The other recorder was watching and has not seen it.
    Missing,
    /// The other recorder has seen it at a time that cannot be the same. A bound is wrong.
    Apart(ChangeId),
}

/// One change of a point.
#[derive(Clone, Copy, Debug)]
struct Seen {
    change: ChangeId,
    /// To which side; `None` if its source does not say.
    on: Option<bool>,
    /// Where it is in the list: for the search only.
    key: i64,
    /// How far from there it may be.
    width: i64,
}

/// What all contacts say that are wired to two recorders.
#[derive(Debug, Default)]
pub(super) struct Shared {
    /// What single movements that both saw say about their clocks.
    pub(super) links: Vec<Link>,
    /// Changes that are one movement for certain, from either side.
    pub(super) pairs: BTreeMap<ChangeId, ChangeId>,
    /// What is wrong with them.
    pub(super) findings: Vec<ContactFinding>,
}

/// What all contacts say that are wired to two recorders, and what is wrong with them.
pub(super) fn shared(timeline: &Timeline<'_>) -> Shared {
    let mut shared = Shared::default();
    let points = timeline.site.points.iter().enumerate();
    let pairs = points.filter_map(|(index, point)| {
        point.same_as.filter(|other| index < other.0).map(|other| (PointId(index), other))
    });
    for (one, other) in pairs {
        pair(timeline, one, other, &mut shared);
    }
    shared.findings.sort_unstable();
    shared
}

fn pair(timeline: &Timeline<'_>, one: PointId, other: PointId, shared: &mut Shared) {
    let points = &timeline.site.points;
    let (Some(point), Some(other_point)) = (points.get(one.0), points.get(other.0)) else {
        return;
    };
    let is_inverted = point.inverted || other_point.inverted;
    let seen = changes_of(timeline, point, false);
    let other_seen = changes_of(timeline, other_point, is_inverted);
    for (these, those, from, to) in
        [(&seen, &other_seen, one, other), (&other_seen, &seen, other, one)]
    {
        for change in these {
            if is_chatter(timeline, these, change) || change.width > WIDEST_US {
                continue;
            }
            match partners(timeline, change, those).as_slice() {
                [partner] if from == one => {
                    let is_mutual = partners(timeline, partner, these).len() == 1;
                    if is_mutual
                        && change.on.is_some()
                        && change.on == partner.on
                        && !is_chatter(timeline, those, partner)
                        && is_one(timeline, change.change, partner.change)
                    {
                        let (change, partner) = (change.change, partner.change);
                        shared.pairs.extend([(change, partner), (partner, change)]);
                        let why = LinkReason::Contact(one.0, other.0);
                        shared.links.extend(link(timeline, change, partner, why));
                    }
                }
                [] => {
                    if let Some(trouble) = trouble(timeline, change, those, to) {
                        let change = change.change;
                        let (point, other) = (from, to);
                        shared.findings.push(ContactFinding { change, point, other, trouble });
                    }
                }
                _ => {}
            }
        }
    }
}

/// All changes of a point whose time is known, by key.
fn changes_of(timeline: &Timeline<'_>, point: &Point, is_inverted: bool) -> Vec<Seen> {
    let mut seen = Vec::new();
    let recorders = timeline.history.recorders.iter().enumerate();
    for (index, recorder) in recorders.filter(|(_, found)| found.site == Some(point.recorder)) {
        for (life_index, life) in recorder.lives.iter().enumerate() {
            let changes = life.entries.iter().enumerate();
            for (place, held) in
                changes.filter(|(_, held)| held.entry.changed.contains(point.input))
            {
                let event = event_id(index, life_index, place);
                let (Some(key), Some(width)) =
                    (timeline.sort_key(event), narrowest(timeline, event))
                else {
                    continue;
                };
                let on = held.state_of(point.input).map(|on| on != is_inverted);
                let change = ChangeId { event, input: point.input };
                seen.push(Seen { change, on, key, width });
            }
        }
    }
    seen.sort_by_key(|seen| (seen.key, seen.change));
    seen
}

/// How wide the narrowest bound of an entry is.
fn narrowest(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    let bounds = timeline.samples(event).map(|(_, bound)| bound);
    let known = bounds.filter(|&(lo, hi)| lo != i64::MIN && hi != i64::MAX);
    known.map(|(lo, hi)| hi.saturating_sub(lo)).min()
}

impl Seen {
    /// Whether both may be movements to the same side.
    fn may_be_alike(&self, other: &Seen) -> bool {
        self.on.zip(other.on).is_none_or(|(one, other)| one == other)
    }
}

/// The changes that may be the same movement. Those to the other side are none.
fn partners(timeline: &Timeline<'_>, change: &Seen, those: &[Seen]) -> Vec<Seen> {
    let reach = WIDEST_US;
    let first = those.partition_point(|seen| seen.key < change.key.saturating_sub(reach));
    let near = those.iter().skip(first);
    near.take_while(|seen| seen.key <= change.key.saturating_add(reach))
        .filter(|seen| {
            seen.may_be_alike(change) && may_be_one(timeline, change.change, seen.change)
        })
        .take(2)
        .copied()
        .collect()
}

/// Whether two changes may be one movement.
fn may_be_one(timeline: &Timeline<'_>, one: ChangeId, other: ChangeId) -> bool {
    let delta = timeline.delta(one, other);
    matches!((delta.lo_us, delta.hi_us), (Some(lo), Some(hi)) if lo <= 0 && 0 <= hi)
}

/// Whether a change is one of so many that nobody can say which is which.
fn is_chatter(timeline: &Timeline<'_>, these: &[Seen], change: &Seen) -> bool {
    let chatter = timeline.site.incident.chatter;
    let from = change.key.saturating_sub(chatter.within_us);
    let first = these.partition_point(|seen| seen.key < from);
    let near = these
        .iter()
        .skip(first)
        .take_while(|seen| seen.key <= change.key.saturating_add(chatter.within_us));
    near.count() >= chatter.changes as usize
}

/// Whether two changes that may be one movement are one. If they were not, one of them came first,
/// and either log would lack the partner of the other's change: so it is enough that one of the two
/// is known there. Neither can have overlooked what lasted.
fn is_one(timeline: &Timeline<'_>, one: ChangeId, other: ChangeId) -> bool {
    let shortest_us = shortest_seen_us(timeline, one).max(shortest_seen_us(timeline, other));
    let lasted = |change| stands_alone(timeline, change, shortest_us);
    let reaches = |from, to, side| reaches(timeline, from, to, side);
    lasted(one)
        && lasted(other)
        && (reaches(other, one, Side::After) || reaches(one, other, Side::Before))
        && (reaches(other, one, Side::Before) || reaches(one, other, Side::After))
}

/// What is shorter than this, in microseconds, the recorder of a change may overlook: it may be
/// over before it arrives, and before the next sample.
fn shortest_seen_us(timeline: &Timeline<'_>, change: ChangeId) -> i64 {
    let (earliest, latest) = timeline.delay_ends(change.event, None);
    latest - earliest
}

/// What both changes being one movement says about the two clocks.
fn link(timeline: &Timeline<'_>, one: ChangeId, other: ChangeId, why: LinkReason) -> Option<Link> {
    let side = |change: ChangeId| {
        let held = timeline.held(change.event)?;
        let run = timeline.clock(change.event)?.sure_run(held)?;
        let x = timeline.model.runs.get(run)?.unwrapped(shown(&held.entry.time)?);
        Some((run, x, timeline.delay_ends(change.event, Some(change.input))))
    };
    // What was added by hand says nothing about the clock.
    if timeline.shift_us(one.event) != 0 || timeline.shift_us(other.event) != 0 {
        return None;
    }
    let (run, x, ends) = side(one)?;
    let (other_run, other_x, other_ends) = side(other)?;
    let (lo, hi) = (other_ends.0 - ends.1, other_ends.1 - ends.0);
    (run != other_run).then_some(Link { one: run, other: other_run, x, other_x, lo, hi, why })
}

/// What is wrong where a change has no partner, if that can be said.
fn trouble(
    timeline: &Timeline<'_>,
    change: &Seen,
    those: &[Seen],
    other: PointId,
) -> Option<ContactTrouble> {
    let quiet = timeline.site.incident.quiet_us;
    let nearest = those
        .iter()
        .filter(|seen| {
            seen.may_be_alike(change) && seen.key.abs_diff(change.key) <= quiet.unsigned_abs()
        })
        .min_by_key(|seen| (seen.key.abs_diff(change.key), seen.change));
    let trouble =
        nearest.map_or(ContactTrouble::Missing, |nearest| ContactTrouble::Apart(nearest.change));
    let point = timeline.site.points.get(other.0)?;
    was_watching(timeline, (change.change, change.key), point).then_some(trouble)
}
