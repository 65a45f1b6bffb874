//! Whether a recorder was watching when another one saw something.
//!
//! That a log has no entry of a movement says something only where the log is known: without a gap,
//! and from an entry that is proven to be earlier to one that is proven to be later. That nobody
//! found more entries is not enough: a recorder that does not record has none, and only the states
//! of its next entry tell.

use super::{ChangeId, EventId, Order, Timeline, event_id};
use crate::history::{Held, LifeHistory};
use crate::site::Point;

/// How many entries on either side of a change are asked whether they are earlier or later.
const MOST_NEAR: usize = 64;

/// Towards which end of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// To earlier entries.
    Before,
    /// To later ones.
    After,
}

impl Side {
    /// The entries on this side of one, from near to far, up to the first place where something is
    /// missing.
    fn entries<'t>(
        self,
        timeline: &'t Timeline<'_>,
        from: EventId,
    ) -> impl Iterator<Item = (EventId, &'t Held)> {
        let start = from.place as usize;
        (1..=MOST_NEAR).map_while(move |steps| {
            let life = timeline.life(from)?;
            let (place, gap) = match self {
                Side::Before => (start.checked_sub(steps)?, start + 1 - steps),
                Side::After => (start + steps, start + steps),
            };
            let held = life.entries.get(place).filter(|_| !life.is_broken_ahead_of(gap))?;
            Some((EventId { place: u32::try_from(place).ok()?, ..from }, held))
        })
    }

    /// The order of something that is on this side.
    fn order(self) -> Order {
        match self {
            Side::Before => Order::Before,
            Side::After => Order::After,
        }
    }
}

/// Whether the log of one change is known from there to an entry that is proven to be on this side
/// of a change of another recorder, and shows nothing on the way that may be the same movement.
pub(super) fn reaches(timeline: &Timeline<'_>, from: ChangeId, to: ChangeId, side: Side) -> bool {
    let Some(held) = timeline.held(from.event) else { return false };
    let on = held.state_of(from.input);
    for (event, held) in side.entries(timeline, from.event) {
        if timeline.order(event, to.event) == side.order() {
            return true;
        }
        let is_other = on.zip(held.state_of(from.input)).is_some_and(|(one, other)| one != other);
        let is_alike = held.entry.changed.contains(from.input) && !is_other;
        if is_alike && may_be_one(timeline, ChangeId { event, ..from }, to) {
            return false;
        }
    }
    false
}

/// Whether a contact was where it was for longer than this before and after a change, so that
/// nobody who watched it can have overlooked that.
pub(super) fn stands_alone(timeline: &Timeline<'_>, change: ChangeId, us: i64) -> bool {
    [Side::Before, Side::After].into_iter().all(|side| {
        for (event, held) in side.entries(timeline, change.event) {
            let is_same = held.entry.changed.contains(change.input);
            let other = (event, is_same.then_some(change.input));
            if timeline.moved_apart((change.event, Some(change.input)), other) > us {
                return true;
            }
            if is_same {
                return false;
            }
        }
        false
    })
}

/// Whether two changes may be one movement, as far as is known.
fn may_be_one(timeline: &Timeline<'_>, one: ChangeId, other: ChangeId) -> bool {
    let delta = timeline.delta(one, other);
    delta.lo_us.is_none_or(|lo| lo <= 0) && delta.hi_us.is_none_or(|hi| 0 <= hi)
}

/// Whether the recorder of a point has an entry that is proven to be earlier than a change and one
/// that is proven to be later, and between them neither a gap nor a change of the point. `key` is
/// where the change is in the list.
pub(super) fn was_watching(
    timeline: &Timeline<'_>,
    (change, key): (ChangeId, i64),
    point: &Point,
) -> bool {
    let recorders = timeline.history.recorders.iter().enumerate();
    let mut lives = recorders
        .filter(|(_, recorder)| recorder.site == Some(point.recorder))
        .flat_map(|(index, recorder)| {
            let lives = recorder.lives.iter().enumerate();
            lives.map(move |(life_index, life)| (event_id(index, life_index, 0), life))
        });
    lives.any(|(first, life)| covers(timeline, (change, key), (first, life), point.input))
}

/// The same for one life, which begins with the entry `first`.
fn covers(
    timeline: &Timeline<'_>,
    (change, key): (ChangeId, i64),
    (first, life): (EventId, &LifeHistory),
    input: u8,
) -> bool {
    let event = |place: usize| {
        let place = u32::try_from(place).unwrap_or(u32::MAX);
        EventId { place, ..first }
    };
    let order = |place: usize| timeline.order(event(place), change.event);
    let near = timeline.place_before(first, key).map_or(0, |place| place + 1);
    let before = (0..near).rev().take(MOST_NEAR).find(|&place| order(place) == Order::Before);
    let after =
        (near..life.entries.len()).take(MOST_NEAR).find(|&place| order(place) == Order::After);
    let Some((before, after)) = before.zip(after) else { return false };
    let within = before + 1..=after;
    let is_gap = life.gaps.iter().any(|gap| within.contains(&gap.place))
        || life.left_out.iter().any(|place| within.contains(place));
    let between = life.entries.get(before + 1..after).unwrap_or_default();
    !is_gap && !between.iter().any(|held| held.entry.changed.contains(input))
}
