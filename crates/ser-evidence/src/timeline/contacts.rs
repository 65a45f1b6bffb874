//! Contacts that are wired to two recorders.
//!
//! Both recorders see the same movement. Where it is certain which change of one is which of the
//! other, the two clocks bound each other. A change without its partner is told: a wire, an input
//! or a clock is not as the site file has it.

use std::collections::BTreeMap;

use super::{ChangeId, EventId, Order, Timeline, event_id};
use crate::clock::LinkReason;
use crate::clock::links::Link;
use crate::history::LifeHistory;
use crate::site::{Point, PointId};
use crate::time::shown;

/// Changes whose times are less certain than this are not paired, in microseconds.
const WIDEST_US: i64 = 60_000_000;

/// How many entries on either side of a change are asked whether they are earlier or later.
const MOST_NEAR: usize = 64;

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
    on: bool,
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
                        && !is_chatter(timeline, those, partner)
                        && is_covered(timeline, change, partner.change.event)
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
                let on = held.entry.state.contains(point.input) != is_inverted;
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

/// The changes in the same direction that may be the same movement.
fn partners(timeline: &Timeline<'_>, change: &Seen, those: &[Seen]) -> Vec<Seen> {
    let reach = WIDEST_US;
    let first = those.partition_point(|seen| seen.key < change.key.saturating_sub(reach));
    let near = those.iter().skip(first);
    near.take_while(|seen| seen.key <= change.key.saturating_add(reach))
        .filter(|seen| seen.on == change.on && may_be_one(timeline, change.change, seen.change))
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

/// Whether nothing is missing around the partner, where another change could have been.
fn is_covered(timeline: &Timeline<'_>, change: &Seen, partner: EventId) -> bool {
    let both = [change.change.event, partner];
    both.into_iter().all(|event| {
        let Some(life) = timeline.life(event) else { return false };
        !life.gaps.iter().any(|gap| {
            let distance = gap.place.abs_diff(event.place as usize);
            distance <= 1 || is_near(timeline, event, gap.place, change)
        })
    })
}

/// Whether a gap may be about as early or late as a change.
fn is_near(timeline: &Timeline<'_>, event: EventId, place: usize, change: &Seen) -> bool {
    let key = |place: usize| {
        let place = u32::try_from(place).unwrap_or(u32::MAX);
        timeline.sort_key(EventId { place, ..event })
    };
    let begins = place.checked_sub(1).and_then(key).unwrap_or(i64::MIN);
    let ends = key(place).unwrap_or(i64::MAX);
    let reach = change.width.saturating_mul(2);
    begins <= change.key.saturating_add(reach) && change.key.saturating_sub(reach) <= ends
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
            seen.on == change.on && seen.key.abs_diff(change.key) <= quiet.unsigned_abs()
        })
        .min_by_key(|seen| (seen.key.abs_diff(change.key), seen.change));
    let trouble =
        nearest.map_or(ContactTrouble::Missing, |nearest| ContactTrouble::Apart(nearest.change));
    was_watching(timeline, change, other).then_some(trouble)
}

/// Whether the recorder of a point has an entry that is proven to be earlier than a change and one that
/// is proven to be later, and between them neither a gap nor a change of the point.
fn was_watching(timeline: &Timeline<'_>, change: &Seen, point: PointId) -> bool {
    let Some(point) = timeline.site.points.get(point.0) else { return false };
    let recorders = timeline.history.recorders.iter().enumerate();
    let mut lives = recorders
        .filter(|(_, recorder)| recorder.site == Some(point.recorder))
        .flat_map(|(index, recorder)| {
            let lives = recorder.lives.iter().enumerate();
            lives.map(move |(life_index, life)| (event_id(index, life_index, 0), life))
        });
    lives.any(|(first, life)| covers(timeline, change, (first, life), point.input))
}

/// The same for one life, which begins with the entry `first`.
fn covers(
    timeline: &Timeline<'_>,
    change: &Seen,
    (first, life): (EventId, &LifeHistory),
    input: u8,
) -> bool {
    let event = |place: usize| {
        let place = u32::try_from(place).unwrap_or(u32::MAX);
        EventId { place, ..first }
    };
    let order = |place: usize| timeline.order(event(place), change.change.event);
    let near = timeline.place_before(first, change.key).map_or(0, |place| place + 1);
    let before = (0..near).rev().take(MOST_NEAR).find(|&place| order(place) == Order::Before);
    let after =
        (near..life.entries.len()).take(MOST_NEAR).find(|&place| order(place) == Order::After);
    let Some((before, after)) = before.zip(after) else { return false };
    let is_gap = life.gaps.iter().any(|gap| (before + 1..=after).contains(&gap.place));
    let between = life.entries.get(before + 1..after).unwrap_or_default();
    !is_gap && !between.iter().any(|held| held.entry.changed.contains(input))
}
