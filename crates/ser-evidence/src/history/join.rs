//! Joins readings of the same life of a log.

use std::collections::{BTreeMap, HashMap};

use ser_proto::{Inputs, TimeStamp};

use super::{Conflict, Held, LifeHistory};
use crate::record::Life;
use crate::time::shown;

/// A reading that does not know which life it read.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    /// In the order of the reading.
    pub(super) entries: Vec<Held>,
    /// Whether it was read by number, so that its sequences are made up.
    pub(super) is_by_number: bool,
}

/// What a recorder counts modulo.
const WRAP: u64 = 1 << 16;

/// All lives, each with its entries once and by sequence. Entries of a place that is taken go to
/// `conflicts`.
pub(super) fn lives(
    named: BTreeMap<Life, Vec<Held>>,
    mut unnamed: Vec<Segment>,
    conflicts: &mut Vec<Conflict>,
) -> Vec<LifeHistory> {
    let named = named.into_iter().map(|(life, entries)| LifeHistory {
        life: Some(life),
        entries,
        ..LifeHistory::default()
    });
    let mut lives: Vec<LifeHistory> = named.collect();
    for life in &mut lives {
        tidy(life, conflicts);
    }
    // By content, so that the order of the sources does not matter. The longest first: it is most
    // likely to hold what the others share.
    unnamed.sort_by_cached_key(|segment| {
        let entries: Vec<_> = segment.entries.iter().map(key).collect();
        (usize::MAX - entries.len(), segment.is_by_number, entries)
    });
    let mut left = unnamed;
    // A segment may be joined only after another one has been.
    loop {
        let before = left.len();
        left.retain_mut(|segment| !joins_any(&mut lives, segment, conflicts));
        if left.len() == before {
            let Some(first) = (!left.is_empty()).then(|| left.remove(0)) else { break };
            let is_by_number = first.is_by_number;
            let mut life =
                LifeHistory { entries: first.entries, is_by_number, ..LifeHistory::default() };
            tidy(&mut life, conflicts);
            lives.push(life);
        }
    }
    lives
}

/// Everything that distinguishes entries, in an order.
fn key(held: &Held) -> (u64, i64, u32, u32, u16, u32) {
    let Held { sequence, entry, number, known } = held;
    let at = shown(&entry.time).map_or(i64::MIN, crate::time::Moment::us);
    (*sequence, at, entry.changed.0, entry.state.0, *number, known.0)
}

/// Sorts the entries and keeps one for each sequence: the same one whatever their order was.
fn tidy(life: &mut LifeHistory, conflicts: &mut Vec<Conflict>) {
    if !life.entries.is_sorted_by(|one, next| one.sequence < next.sequence) {
        life.entries.sort_unstable_by_key(key);
    }
    let name = life.name();
    life.entries.dedup_by(|later, kept| {
        let is_same_place = later.sequence == kept.sequence;
        if is_same_place && !later.agrees(kept) {
            let (sequence, shown, other) = (kept.sequence, kept.entry, later.entry);
            let conflict = Conflict { life: name, sequence, shown, other };
            if !conflicts.contains(&conflict) {
                conflicts.push(conflict);
            }
        } else if is_same_place && kept.known.0 & !later.known.0 == 0 {
            // It knows at least as much.
            *kept = *later;
        }
        is_same_place
    });
}

/// Adds a segment to the first life that it is a reading of.
fn joins_any(
    lives: &mut [LifeHistory],
    segment: &mut Segment,
    conflicts: &mut Vec<Conflict>,
) -> bool {
    if segment.is_by_number {
        return false;
    }
    let contents: Contents = segment.entries.iter().map(|held| (content(held), *held)).collect();
    for life in lives.iter_mut().filter(|life| !life.is_by_number) {
        let Some(shift) = common_shift(life, &contents) else { continue };
        let moved = |held: &Held| {
            Some(Held { sequence: held.sequence.checked_add_signed(shift)?, ..*held })
        };
        let contradicts = |held: &Held| {
            let moved = moved(held)?;
            life.entry(moved.sequence).filter(|known| !known.agrees(&moved))
        };
        if segment.entries.iter().any(|held| contradicts(held).is_some()) {
            continue;
        }
        life.entries.extend(segment.entries.iter().filter_map(moved));
        tidy(life, conflicts);
        return true;
    }
    false
}

/// Entries of a segment by what is always known of them.
type Contents = HashMap<(u64, TimeStamp, Inputs), Held>;

fn content(held: &Held) -> (u64, TimeStamp, Inputs) {
    (held.sequence % WRAP, held.entry.time, held.entry.changed)
}

/// What has to be added to a segment's sequences so that an entry of it is one of the life's.
fn common_shift(life: &LifeHistory, contents: &Contents) -> Option<i64> {
    life.entries.iter().find_map(|held| {
        let same = contents.get(&content(held)).filter(|same| same.agrees(held))?;
        i64::try_from(i128::from(held.sequence) - i128::from(same.sequence)).ok()
    })
}
