//! What finds the places of clocks in a part.
//!
//! A place in a life without a name is found by the entry before it. A part may not hold that entry.
//! Then an entry that it does hold is told with the place, and how far that is ahead.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use ser_evidence::history::LifeHistory;
use ser_evidence::record::{Fellow, Place};
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::selection::Selection;

/// The entries that a part holds.
pub(super) struct Anchors {
    /// By recorder and life: the first and the last place. `None` for everything.
    held: Option<HashMap<(usize, usize), (usize, usize)>>,
}

impl Anchors {
    pub(super) fn of(timeline: &Timeline<'_>, selection: &Selection) -> Anchors {
        if selection.begins().is_none() {
            return Anchors { held: None };
        }
        let mut held = HashMap::new();
        for item in selection.items(timeline) {
            let Item::Entry(EventId { recorder, life, place }) = item else { continue };
            let place = place as usize;
            match held.entry((recorder as usize, life as usize)) {
                Entry::Vacant(vacant) => _ = vacant.insert((place, place)),
                Entry::Occupied(mut known) => {
                    let (first, last) = *known.get();
                    known.insert((first.min(place), last.max(place)));
                }
            }
        }
        Anchors { held: Some(held) }
    }

    /// A place so that it is found in the part. `None` if it is in a life without a name of which
    /// the part holds nothing: nobody could tell that it is not in another one. `None` also for an
    /// observation of a clock that was set before the entries of the part came, or after that, if
    /// only entries outside say so.
    pub(super) fn in_part(
        &self,
        timeline: &Timeline<'_>,
        (recorder, observation): (usize, Option<usize>),
        place: &Place,
    ) -> Option<Place> {
        let Some(held) = self.held.as_ref() else {
            return Some(*place);
        };
        let Some((index, after)) = timeline.located(recorder, place) else { return Some(*place) };
        let Some(&(first, last)) = held.get(&(recorder, index)) else {
            return place.life.is_known().then_some(*place);
        };
        let event = |place: usize| event_id(recorder, index, place);
        if observation.is_some_and(|found| timeline.is_of_others(found, event(first), event(last)))
        {
            return None;
        }
        if place.life.is_known() {
            return Some(*place);
        }
        let life = timeline.history().recorders.get(recorder)?.lives.get(index)?;
        let is_held = (first..=last).contains(&life.place_of(after)) && life.entry(after).is_some();
        if is_held && place.newest.is_some() {
            return Some(*place);
        }
        Some(Place { fellow: fellow(life, first, after), ..*place })
    }
}

fn event_id(recorder: usize, life: usize, place: usize) -> EventId {
    let index = |index: usize| u32::try_from(index).unwrap_or(u32::MAX);
    EventId { recorder: index(recorder), life: index(life), place: index(place) }
}

/// The entry at this place as one by which a sequence is found.
fn fellow(life: &LifeHistory, place: usize, after: u64) -> Option<Fellow> {
    let held = life.entries.get(place)?;
    let ahead = i64::try_from(i128::from(held.sequence) - i128::from(after)).ok()?;
    Some(Fellow { ahead, entry: held.entry })
}
