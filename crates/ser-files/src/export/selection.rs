//! Which part of a timeline is exported.

use std::collections::HashSet;

use ser_evidence::incident::Incident;
use ser_evidence::timeline::{EventId, Item, Timeline};

/// Everything, or what belongs to an incident.
#[derive(Debug, Default)]
pub struct Selection {
    part: Option<Part>,
}

/// A part of the list.
#[derive(Debug)]
struct Part {
    /// The lowest and the highest sort key of an entry.
    first: i64,
    last: i64,
    /// What is missing in it. The entries around a gap may be outside.
    gaps: HashSet<(EventId, usize)>,
}

impl Selection {
    /// The whole timeline, with entries whose time is not known at its end.
    #[must_use]
    pub const fn everything() -> Selection {
        Selection { part: None }
    }

    /// The entries of an incident, and what is missing in it.
    #[must_use]
    pub fn of(timeline: &Timeline<'_>, incident: &Incident) -> Selection {
        // The list is in another order than that of its keys where a guess is overruled.
        let keys = || incident.events.iter().filter_map(|&event| timeline.sort_key(event));
        let (first, last) = (keys().min(), keys().max());
        let (first, last) = (first.unwrap_or(i64::MIN), last.unwrap_or(i64::MAX));
        let gaps = incident.gaps.iter().copied().collect();
        Selection { part: Some(Part { first, last, gaps }) }
    }

    /// What is selected, in the order of the timeline.
    pub(crate) fn items<'t>(
        &'t self,
        timeline: &'t Timeline<'t>,
    ) -> impl Iterator<Item = Item> + use<'t> {
        let holds = move |item: &Item| match &self.part {
            Some(part) => part.holds(timeline, *item),
            None => true,
        };
        timeline.items().filter(holds)
    }

    /// What is missing in the part, and begins or may begin after an entry outside of it.
    pub(super) fn gaps_from_outside<'t>(
        &'t self,
        timeline: &'t Timeline<'t>,
    ) -> impl Iterator<Item = (EventId, usize)> + use<'t> {
        self.part.iter().flat_map(move |part| {
            let is_from_outside = move |(event, _): &(EventId, usize)| {
                let before = event.place.checked_sub(1).map(|place| EventId { place, ..*event });
                before.is_some_and(|before| !part.holds(timeline, Item::Entry(before)))
            };
            let mut gaps: Vec<(EventId, usize)> =
                part.gaps.iter().copied().filter(is_from_outside).collect();
            gaps.sort_unstable();
            gaps
        })
    }

    /// Where the part begins in the list, if it is one.
    pub(super) fn begins(&self) -> Option<i64> {
        self.part.as_ref().map(|part| part.first)
    }
}

impl Part {
    fn holds(&self, timeline: &Timeline<'_>, item: Item) -> bool {
        match item {
            Item::Entry(event) | Item::ClockSet(event) => {
                let key = timeline.sort_key(event);
                key.is_some_and(|key| (self.first..=self.last).contains(&key))
            }
            Item::Gap(event, index) => self.gaps.contains(&(event, index)),
        }
    }
}
