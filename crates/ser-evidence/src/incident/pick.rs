//! Which entries belong to an incident, and which incident is meant.

use crate::site::Role;
use crate::time::{Moment, Utc};
use crate::timeline::{ChangeId, EventId, Item, Timeline, event_id};

use super::points::Points;

/// Entries that belong together: between neighbours there is no quiet time longer than the site
/// says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Incident {
    /// Its entries, in the order of the timeline; at least one.
    pub events: Vec<EventId>,
    /// What is missing between them, or right before the first of a recorder: the entry that comes
    /// next, and the index of the gap in its life.
    pub gaps: Vec<(EventId, usize)>,
    /// Entries ahead of which a clock was set, or may have been.
    pub clock_sets: Vec<EventId>,
    /// The entries that came before the time that was asked for, with no quiet time between.
    pub earlier: Vec<EventId>,
    /// How many came after it, with no quiet time between.
    pub later: usize,
}

/// Which incident is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// The last one in which a point moved whose role trips; without such a point, the last one.
    LastTrip,
    /// The last one.
    Last,
    /// The one that was going on between these times, ends included, else the one nearest to them.
    /// Of several the last one in which a point moved whose role trips, if there is one.
    Around(Moment<Utc>, Moment<Utc>),
    /// Everything between two times, ends included; `None` is no end.
    Between(Option<Moment<Utc>>, Option<Moment<Utc>>),
}

impl Incident {
    /// Picks an incident. `None` if there is none.
    #[must_use]
    pub fn pick(timeline: &Timeline<'_>, which: Which) -> Option<Incident> {
        let mut incident = match which {
            Which::Between(since, until) => between(timeline, since, until),
            _ => best(timeline, which),
        }?;
        incident.add_spanning_gaps(timeline);
        Some(incident)
    }

    /// The same with what is missing over the whole incident: the entries on both sides are outside
    /// of it.
    #[must_use]
    pub fn completed(mut self, timeline: &Timeline<'_>) -> Incident {
        self.add_spanning_gaps(timeline);
        self
    }

    fn add_spanning_gaps(&mut self, timeline: &Timeline<'_>) {
        let (Some(&first), Some(&last)) = (self.events.first(), self.events.last()) else { return };
        let (Some(first), Some(last)) = (earliest(timeline, first), latest(timeline, last)) else {
            return;
        };
        for (recorder, history) in timeline.history().recorders.iter().enumerate() {
            for (life, of_life) in history.lives.iter().enumerate() {
                for (index, gap) in of_life.gaps.iter().enumerate() {
                    let at = event_id(recorder, life, gap.place);
                    let (begins, ends) = gap_keys(timeline, at);
                    if begins <= last && ends >= first && !self.gaps.contains(&(at, index)) {
                        self.gaps.push((at, index));
                    }
                }
            }
        }
    }
}

/// How early an entry may be in the list, by all that is known of its time.
fn earliest(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    let lo = timeline.moved_utc(event, None).lo().map(Moment::us);
    timeline.sort_key(event).map(|key| lo.map_or(key, |lo| lo.min(key)))
}

/// How late an entry may be in the list.
fn latest(timeline: &Timeline<'_>, event: EventId) -> Option<i64> {
    let hi = timeline.moved_utc(event, None).hi().map(Moment::us);
    timeline.sort_key(event).map(|key| hi.map_or(key, |hi| hi.max(key)))
}

/// Between which places in the list something is missing ahead of this entry, or at the end of its
/// life.
fn gap_keys(timeline: &Timeline<'_>, ahead_of: EventId) -> (i64, i64) {
    let before = ahead_of.place.checked_sub(1).map(|place| EventId { place, ..ahead_of });
    let begins = before.and_then(|before| earliest(timeline, before)).unwrap_or(i64::MIN);
    if timeline.held(ahead_of).is_some() {
        return (begins, latest(timeline, ahead_of).unwrap_or(i64::MAX));
    }
    // Another life came after this one.
    let lives = timeline.recorder(ahead_of).map_or(0, |recorder| recorder.lives.len());
    let firsts = (0..lives)
        .filter_map(|life| timeline.sort_key(event_id(ahead_of.recorder as usize, life, 0)));
    (begins, firsts.filter(|&first| first > begins).min().unwrap_or(i64::MAX))
}

/// The one that fits best; of equals the last one.
fn best(timeline: &Timeline<'_>, which: Which) -> Option<Incident> {
    let points = Points::new(timeline);
    let mut best: Option<(Rank, Incident)> = None;
    for_each(timeline, |incident, keys| {
        let rank = Rank::of(timeline, &points, &incident, keys, which);
        if best.as_ref().is_none_or(|(known, _)| rank >= *known) {
            best = Some((rank, incident));
        }
    });
    best.map(|(_, incident)| incident)
}

impl Incident {
    /// All incidents, in order. What is missing over a whole one is only in one that was
    /// [completed](Self::completed).
    #[must_use]
    pub fn all(timeline: &Timeline<'_>) -> Vec<Incident> {
        let mut all = Vec::new();
        for_each(timeline, |incident, _| all.push(incident));
        all
    }
}

/// How well an incident fits; of equals the later one is meant.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Rank {
    /// The less, the further away.
    nearness: i64,
    trips: bool,
}

impl Rank {
    fn of(
        timeline: &Timeline<'_>,
        points: &Points,
        incident: &Incident,
        (first, last): (i64, i64),
        which: Which,
    ) -> Rank {
        let trips = || has_trip(timeline, points, incident);
        match which {
            Which::LastTrip => Rank { nearness: 0, trips: trips() },
            Which::Last | Which::Between(..) => Rank { nearness: 0, trips: false },
            Which::Around(from, until) => {
                let (later, earlier) =
                    (first.saturating_sub(until.us()), from.us().saturating_sub(last));
                let distance = later.max(earlier).max(0);
                Rank { nearness: -distance, trips: trips() }
            }
        }
    }
}

/// Whether a point went on whose role trips, or may have.
fn has_trip(timeline: &Timeline<'_>, points: &Points, incident: &Incident) -> bool {
    let site = timeline.site();
    let trips = |event: &EventId| {
        let Some(held) = timeline.held(*event) else { return false };
        held.entry.changed.numbers().any(|input| {
            let point = points.of(ChangeId { event: *event, input });
            let role = point.and_then(|point| site.points.get(point.0)?.role);
            matches!(role, Some(Role::Trip | Role::Lockout)) && held.state_of(input) != Some(false)
        })
    };
    incident.events.iter().any(trips)
}

/// Hands out each incident, with the keys of its first and last entry. Entries without any time
/// belong to none.
fn for_each(timeline: &Timeline<'_>, mut take: impl FnMut(Incident, (i64, i64))) {
    let quiet = timeline.site().incident.quiet_us;
    let mut incident = Incident::default();
    let mut keys = (0, 0);
    for item in timeline.items() {
        let (Item::Entry(event) | Item::Gap(event, _) | Item::ClockSet(event)) = item;
        let Some(key) = timeline.sort_key(event) else {
            // What is missing at the end of a log belongs to what came before.
            if let Item::Gap(event, index) = item
                && timeline.held(event).is_none()
                && incident.events.last().is_some_and(|last| last.recorder == event.recorder)
            {
                incident.gaps.push((event, index));
            }
            continue;
        };
        if !incident.events.is_empty() && key.saturating_sub(keys.1) > quiet {
            take(std::mem::take(&mut incident), keys);
        }
        match item {
            Item::Entry(event) => {
                if incident.events.is_empty() {
                    keys.0 = key;
                }
                keys.1 = key;
                incident.events.push(event);
            }
            Item::Gap(event, index) => incident.gaps.push((event, index)),
            Item::ClockSet(event) => incident.clock_sets.push(event),
        }
    }
    if !incident.events.is_empty() {
        take(incident, keys);
    }
}

/// Everything between two times, as one incident.
fn between(
    timeline: &Timeline<'_>,
    since: Option<Moment<Utc>>,
    until: Option<Moment<Utc>>,
) -> Option<Incident> {
    let (since, until) = (since.map_or(i64::MIN, Moment::us), until.map_or(i64::MAX, Moment::us));
    let mut incident = Incident::default();
    let (mut before, mut after) = (Before::default(), After::default());
    let quiet = timeline.site().incident.quiet_us;
    for item in timeline.items() {
        let (Item::Entry(event) | Item::Gap(event, _) | Item::ClockSet(event)) = item;
        let Some(key) = timeline.sort_key(event) else { continue };
        if (since..=until).contains(&key) {
            match item {
                Item::Entry(event) => {
                    if incident.events.is_empty() {
                        incident.earlier = std::mem::take(before.joined_with(key, quiet));
                    }
                    after = After { last: Some(key), entries: 0 };
                    incident.events.push(event);
                }
                Item::Gap(event, index) => incident.gaps.push((event, index)),
                Item::ClockSet(event) => incident.clock_sets.push(event),
            }
        } else if let Item::Entry(event) = item {
            if key < since {
                before.joined_with(key, quiet).push(event);
                before.last = Some(key);
            } else if after.last.is_some_and(|last| key.saturating_sub(last) <= quiet) {
                after = After { last: Some(key), entries: after.entries + 1 };
            }
        }
    }
    incident.later = after.entries;
    (!incident.events.is_empty()).then_some(incident)
}

/// Entries that follow each other without a quiet time, after a time that was asked for.
#[derive(Clone, Copy, Debug, Default)]
struct After {
    last: Option<i64>,
    entries: usize,
}

/// The same before one.
#[derive(Debug, Default)]
struct Before {
    last: Option<i64>,
    entries: Vec<EventId>,
}

impl Before {
    /// Those of them that an entry joins. The others are forgotten.
    fn joined_with(&mut self, key: i64, quiet: i64) -> &mut Vec<EventId> {
        if self.last.is_none_or(|last| key.saturating_sub(last) > quiet) {
            self.entries.clear();
        }
        &mut self.entries
    }
}
