//! What moved first: a set, because it may not be known.

use std::collections::{BTreeMap, BTreeSet};

use super::completeness::is_covered_until;
use super::pick::Incident;
use super::points::Points;
use crate::clock::Home;
use crate::site::GroupId;
use crate::time::Moment;
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
    let begun = Begun::new(timeline, incident, &firsts);
    let candidates: Vec<EventId> =
        firsts.iter().copied().filter(|&event| !begun.is_out(event)).collect();
    let is_ahead = |gap: &(EventId, usize)| {
        let (after, _) = *gap;
        begun.first_of(after).is_none_or(|first| after.place <= first)
    };
    FirstOut {
        changes: movements(timeline, &firsts, &candidates, counts),
        gaps: incident.gaps.iter().copied().filter(is_ahead).collect(),
        unread: unread(timeline, incident, &candidates),
        earlier: incident.earlier.len(),
    }
}

/// By what an instant is known: a scale, or what all scales say of UTC.
type Scale = Option<Home>;

/// The entries that rule others out: in each life the first one that counts, and all after it.
struct Begun<'t> {
    timeline: &'t Timeline<'t>,
    /// The place of the first one, by recorder and life.
    firsts: BTreeMap<(u32, u32), u32>,
    all: Vec<EventId>,
    by_recorder: BTreeMap<u32, Vec<EventId>>,
    /// On each scale the one that moved earliest at the latest, and the same among other lives than
    /// that one's. What these do not rule out, no entry rules out on that scale.
    earliest: BTreeMap<Scale, [Option<(i64, EventId)>; 2]>,
}

impl<'t> Begun<'t> {
    fn new(timeline: &'t Timeline<'t>, incident: &Incident, firsts: &[EventId]) -> Begun<'t> {
        let mut begun = Begun {
            timeline,
            firsts: firsts.iter().map(|first| (life_of(*first), first.place)).collect(),
            all: Vec::new(),
            by_recorder: BTreeMap::new(),
            earliest: BTreeMap::new(),
        };
        for &event in &incident.events {
            if begun.first_of(event).is_some_and(|first| first <= event.place) {
                begun.add(event);
            }
        }
        begun
    }

    fn add(&mut self, event: EventId) {
        self.all.push(event);
        self.by_recorder.entry(event.recorder).or_default().push(event);
        for (scale, (_, hi)) in scales(self.timeline, event) {
            let Some(hi) = hi else { continue };
            let [first, second] = self.earliest.entry(scale).or_default();
            let is_same_life = |known: &(i64, EventId)| life_of(known.1) == life_of(event);
            if first.is_none_or(|(least, _)| hi < least) {
                // The one before is second, unless it is of this life.
                *second = first.filter(|known| !is_same_life(known)).or(*second);
                *first = Some((hi, event));
            } else if first.is_some_and(|known| !is_same_life(&known))
                && second.is_none_or(|(least, _)| hi < least)
            {
                *second = Some((hi, event));
            }
        }
    }

    /// The place of the first entry of this life that counts.
    fn first_of(&self, event: EventId) -> Option<u32> {
        self.firsts.get(&life_of(event)).copied()
    }

    /// Whether something of another life is proven to have been earlier.
    fn is_out(&self, event: EventId) -> bool {
        let is_earlier = |other: &EventId| self.timeline.order(*other, event) == Order::Before;
        let mut may_be_earlier = false;
        for (scale, (lo, _)) in scales(self.timeline, event) {
            let ends = self.earliest.get(&scale).into_iter().flatten().flatten();
            let others = ends.filter(|(_, other)| life_of(*other) != life_of(event));
            for (_, other) in others.filter(|(hi, _)| lo.is_some_and(|lo| *hi < lo)) {
                if is_earlier(other) {
                    return true;
                }
                may_be_earlier = true;
            }
        }
        // Without a scale, one clock says what was earlier, or a link between two.
        match may_be_earlier || self.timeline.has_links() {
            true => self.all.iter().any(is_earlier),
            false => self.by_recorder.get(&event.recorder).into_iter().flatten().any(is_earlier),
        }
    }
}

const fn life_of(event: EventId) -> (u32, u32) {
    (event.recorder, event.life)
}

/// When the contacts of an entry moved, on each scale on which that is known.
fn scales(
    timeline: &Timeline<'_>,
    event: EventId,
) -> impl Iterator<Item = (Scale, (Option<i64>, Option<i64>))> {
    let utc = timeline.moved_utc(event, None);
    let utc = (utc.lo().map(Moment::us), utc.hi().map(Moment::us));
    let on = timeline.moved_on(event, None);
    on.into_iter().map(|(home, ends)| (Some(home), ends)).chain([(None, utc)])
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
    let events = incident.events.iter().chain(incident.gaps.iter().map(|(event, _)| event));
    let here: BTreeSet<u32> = events.map(|event| event.recorder).collect();
    let is_there =
        |recorder: u32| here.contains(&recorder) || is_covered_until(timeline, recorder, first, 0);
    recorders.filter(|&recorder| !is_there(recorder)).collect()
}

fn changes<'t>(timeline: &'t Timeline<'_>, event: EventId) -> impl Iterator<Item = ChangeId> + 't {
    let changed = timeline.held(event).map(|held| held.entry.changed);
    let inputs = changed.into_iter().flat_map(ser_proto::Inputs::numbers);
    inputs.map(move |input| ChangeId { event, input })
}
