//! What moved first: a set, because it may not be known.

use std::collections::BTreeSet;

use super::completeness::is_covered_until;
use super::pick::Incident;
use super::points::Points;
use crate::site::GroupId;
use crate::timeline::{ChangeId, EventId, Order, Timeline};

/// Everything that may have moved first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FirstOut {
    /// Changes, in the order of the timeline. With a single one, and no gap, it is known. A movement
    /// that two recorders saw is here once, by the change that comes first in the timeline.
    pub changes: Vec<ChangeId>,
    /// What is missing may have been first, too: the entry after the gap, and the gap's index in
    /// its life.
    pub gaps: Vec<(EventId, usize)>,
    /// Recorders, by their indices in the history, that have nothing in the incident and are not
    /// known to have been read since it began.
    pub unread: Vec<u32>,
    /// How many entries of the incident came before the time that was asked for. What moved first
    /// of all may be in one of them.
    pub earlier: usize,
}

impl FirstOut {
    /// The change that was first, if that is known.
    #[must_use]
    pub fn known(&self) -> Option<ChangeId> {
        match (&self.changes[..], &self.gaps[..], &self.unread[..], self.earlier) {
            ([only], [], [], 0) => Some(*only),
            _ => None,
        }
    }

    /// Whether this change is one of them, or the same movement as one of them.
    #[must_use]
    pub fn includes(&self, timeline: &Timeline<'_>, change: ChangeId) -> bool {
        let is_here = |change| self.changes.contains(&change);
        is_here(change) || timeline.same_movement(change).is_some_and(is_here)
    }
}

/// What moved first in the whole incident.
pub(super) fn of_all(timeline: &Timeline<'_>, incident: &Incident) -> FirstOut {
    of(timeline, incident, &|_| true)
}

/// What moved first in each group that wants to know.
pub(super) fn of_groups(
    timeline: &Timeline<'_>,
    points: &Points,
    incident: &Incident,
) -> Vec<(GroupId, FirstOut)> {
    let site = timeline.site();
    let groups = site.groups.iter().enumerate().filter(|(_, group)| group.first_out);
    let group_of =
        |change: ChangeId| points.of(change).and_then(|point| site.points.get(point.0)?.group);
    groups
        .map(|(index, _)| {
            let group = GroupId(index);
            (group, of(timeline, incident, &|change| group_of(change) == Some(group)))
        })
        .filter(|(_, first_out)| !first_out.changes.is_empty())
        .collect()
}

/// Candidates are the inputs of the first entry of each life. One is out if something of another
/// life is proven to have been earlier, and with it that life's first entry. A contact that two
/// recorders watch moves once, so both its changes are one candidate.
fn of(timeline: &Timeline<'_>, incident: &Incident, counts: &dyn Fn(ChangeId) -> bool) -> FirstOut {
    let mut lives = BTreeSet::new();
    let mut is_first = |event: &&EventId| {
        changes(timeline, **event).any(counts) && lives.insert((event.recorder, event.life))
    };
    let firsts: Vec<EventId> = incident.events.iter().filter(&mut is_first).copied().collect();
    let has_begun = |event: &EventId| {
        let is_begun_by = |first: &EventId| {
            (first.recorder, first.life) == (event.recorder, event.life)
                && first.place <= event.place
        };
        firsts.iter().any(is_begun_by)
    };
    let is_out = |event: EventId| {
        let is_earlier = |other: &EventId| timeline.order(*other, event) == Order::Before;
        incident.events.iter().any(|other| has_begun(other) && is_earlier(other))
    };
    let candidates: Vec<EventId> = firsts.iter().copied().filter(|&event| !is_out(event)).collect();
    let is_ahead = |gap: &(EventId, usize)| {
        let (after, _) = *gap;
        let first = firsts
            .iter()
            .find(|first| (first.recorder, first.life) == (after.recorder, after.life));
        first.is_none_or(|first| after.place <= first.place)
    };
    FirstOut {
        changes: movements(timeline, &firsts, &candidates, counts),
        gaps: incident.gaps.iter().copied().filter(is_ahead).collect(),
        unread: unread(timeline, incident, &candidates),
        earlier: incident.earlier,
    }
}

/// The changes of these candidates, each movement once. One is out if another recorder saw the same
/// movement, and there something else is proven to have been earlier.
fn movements(
    timeline: &Timeline<'_>,
    firsts: &[EventId],
    candidates: &[EventId],
    counts: &dyn Fn(ChangeId) -> bool,
) -> Vec<ChangeId> {
    let firsts: Vec<ChangeId> = counted(timeline, firsts, counts).collect();
    let mut movements: Vec<ChangeId> = Vec::new();
    for change in counted(timeline, candidates, counts) {
        let same = timeline.same_movement(change);
        let is_before =
            |first: &ChangeId| timeline.delta(*first, change).lo_us.is_some_and(|least| least > 0);
        let is_later = same.is_some() && firsts.iter().any(is_before);
        if !is_later && same.is_none_or(|same| !movements.contains(&same)) {
            movements.push(change);
        }
    }
    movements
}

/// The changes of some entries that count.
fn counted<'t>(
    timeline: &'t Timeline<'_>,
    events: &'t [EventId],
    counts: &'t dyn Fn(ChangeId) -> bool,
) -> impl Iterator<Item = ChangeId> + 't {
    let all = events.iter().flat_map(|&event| changes(timeline, event));
    all.filter(|change| counts(*change))
}

/// Recorders of which nothing is known at the time of the candidates.
fn unread(timeline: &Timeline<'_>, incident: &Incident, candidates: &[EventId]) -> Vec<u32> {
    let first = candidates.first().and_then(|&first| changes(timeline, first).next());
    let Some(first) = first else { return Vec::new() };
    let recorders = 0..u32::try_from(timeline.history().recorders.len()).unwrap_or(u32::MAX);
    let is_there = |recorder: u32| {
        incident.events.iter().any(|event| event.recorder == recorder)
            || incident.gaps.iter().any(|(event, _)| event.recorder == recorder)
            || is_covered_until(timeline, recorder, first, 0)
    };
    recorders.filter(|&recorder| !is_there(recorder)).collect()
}

fn changes<'t>(timeline: &'t Timeline<'_>, event: EventId) -> impl Iterator<Item = ChangeId> + 't {
    let changed = timeline.held(event).map(|held| held.entry.changed);
    let inputs = changed.into_iter().flat_map(ser_proto::Inputs::numbers);
    inputs.map(move |input| ChangeId { event, input })
}
