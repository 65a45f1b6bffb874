//! What is missing in a life: found in its entries, explained by what was told.

use std::collections::BTreeMap;

use super::{Held, LifeHistory};
use crate::record::{Gap, Life, Lost, Why};

/// Something missing at a place of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogGap {
    /// How many entries of the life come before it, of those that are held: it is ahead of the
    /// entry at this place.
    pub place: usize,
    /// The sequence of the last entry before it; 0 at the beginning of the log.
    pub after: u64,
    /// How many entries.
    pub lost: Lost,
    /// Why.
    pub why: Why,
}

impl LogGap {
    /// The same as a record of the life that it is in.
    #[must_use]
    pub const fn record(&self, life: Life) -> Gap {
        Gap { life, after: Some(self.after), lost: self.lost, why: self.why }
    }
}

/// Gaps as they were told, by where they are.
#[derive(Debug, Default)]
pub(super) struct ToldGaps {
    by_place: BTreeMap<(Life, u64), Vec<Gap>>,
}

impl ToldGaps {
    pub(super) fn new(gaps: Vec<Gap>) -> ToldGaps {
        let mut by_place: BTreeMap<(Life, u64), Vec<Gap>> = BTreeMap::new();
        for gap in gaps {
            if let Some(after) = gap.after {
                by_place.entry((gap.life, after)).or_default().push(gap);
            }
        }
        for gaps in by_place.values_mut() {
            gaps.sort_by_key(|gap| (gap.why, gap.lost));
            gaps.dedup();
        }
        ToldGaps { by_place }
    }

    fn at(&self, life: Life, after: u64) -> &[Gap] {
        self.by_place.get(&(life, after)).map_or(&[], Vec::as_slice)
    }

    /// Why entries are missing after this one. Another source may hold the first entries of what
    /// was missing to the one that told it, so that its gap begins earlier.
    fn why(&self, life: Life, after: u64) -> Option<Why> {
        let earlier = self.by_place.range((life, 0)..=(life, after)).rev();
        let mut gaps =
            earlier.flat_map(|(&(_, from), gaps)| gaps.iter().map(move |gap| (from, gap)));
        let covers = |&(from, gap): &(u64, &Gap)| match gap.lost {
            _ if from == after => true,
            Lost::Exactly(count) | Lost::AtLeast(count) => from + u64::from(count) > after,
            Lost::Unknown => false,
        };
        gaps.find(covers).map(|(_, gap)| gap.why)
    }
}

/// Everything that is missing in a life. Entries of a recorder are counted by it, so nothing is
/// missing between two that follow each other. Those of a list of another device (`is_list`) are
/// counted by whoever read the list: what was told there is in no other source. What was left out
/// is not missing.
pub(super) fn of_life(life: &LifeHistory, told: &ToldGaps, is_list: bool) -> Vec<LogGap> {
    if life.is_by_number {
        return Vec::new();
    }
    let mut gaps = Vec::new();
    let first = life.entries.first().map_or(1, |held| held.sequence);
    if first > 1 {
        gaps.push(hole(life, told, 0, 0, first - 1));
    } else if let Some(first) = life.entries.first() {
        gaps.extend(stays(life, told, is_list, (0, 0), (None, first)));
    }
    for (place, pair) in life.entries.windows(2).enumerate() {
        let [before, after] = pair else { continue };
        let missing = after.sequence - before.sequence - 1;
        if missing > 0 && life.left_out.binary_search(&(place + 1)).is_ok() {
            continue;
        }
        if missing > 0 {
            gaps.push(hole(life, told, place + 1, before.sequence, missing));
        } else if let Some(inputs) = unrecorded(before, after) {
            let (after, why) = (before.sequence, Why::NotRecorded(inputs));
            gaps.push(LogGap { place: place + 1, after, lost: Lost::Unknown, why });
        } else {
            let at = (place + 1, before.sequence);
            gaps.extend(stays(life, told, is_list, at, (Some(before), after)));
        }
    }
    let last = life.entries.last().map_or(0, |held| held.sequence);
    let is_named = life.life.is_some();
    let ends = told.at(life.name(), last).iter().filter(|gap| match (gap.why, gap.lost) {
        (Why::Unreadable, _) => !life.entries.is_empty(),
        // That a recorder was not reached is no loss yet, unless it is known that it has more.
        (Why::LogBeganAnew | Why::NotRecorded(_), _) | (_, Lost::AtLeast(1..)) => is_named,
        _ => is_list && !life.entries.is_empty(),
    });
    for gap in ends {
        let (place, lost, why) = (life.entries.len(), gap.lost, gap.why);
        gaps.push(LogGap { place, after: last, lost, why });
    }
    gaps
}

/// What was told of a place, given with the sequence before it, though no number is skipped there.
/// Inputs that changed without a record are known from the neighbours, if both show their states.
fn stays(
    life: &LifeHistory,
    told: &ToldGaps,
    is_list: bool,
    (place, after): (usize, u64),
    (before, next): (Option<&Held>, &Held),
) -> impl Iterator<Item = LogGap> {
    let known = before.map_or(0, |before| before.known.0 & next.known.0);
    let is_there = move |gap: &&Gap| match gap.why {
        Why::NotRecorded(inputs) => inputs & !known != 0,
        _ => is_list,
    };
    let there = told.at(life.name(), after).iter().filter(is_there);
    there.map(move |&Gap { lost, why, .. }| LogGap { place, after, lost, why })
}

/// Inputs that changed between neighbours without a record.
fn unrecorded(before: &Held, after: &Held) -> Option<u32> {
    let known = before.known.0 & after.known.0;
    let inputs = (before.entry.state.0 ^ after.entry.changed.0 ^ after.entry.state.0) & known;
    (inputs != 0).then_some(inputs)
}

/// Entries that are missing between two that are held. What was told about the place says why.
fn hole(life: &LifeHistory, told: &ToldGaps, place: usize, after: u64, missing: u64) -> LogGap {
    let counted = u32::try_from(missing);
    let missing = counted.unwrap_or(u32::MAX);
    // Before the first reading nobody counted how often the total had wrapped.
    let is_counted = (after > 0 || life.is_exact) && counted.is_ok();
    LogGap {
        place,
        after,
        lost: if is_counted { Lost::Exactly(missing) } else { Lost::AtLeast(missing) },
        why: told.why(life.name(), after).unwrap_or(Why::NotReached),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_a_gap_can_count_is_at_least_that() {
        let life = LifeHistory { is_exact: true, ..LifeHistory::default() };
        let lost = |missing| hole(&life, &ToldGaps::default(), 1, 5, missing).lost;
        assert_eq!(lost(u64::from(u32::MAX)), Lost::Exactly(u32::MAX));
        assert_eq!(lost(u64::from(u32::MAX) + 1), Lost::AtLeast(u32::MAX));
    }
}
