//! Contacts that move many times in a short time.

use std::collections::{BTreeMap, HashMap};

use super::Row;
use crate::timeline::{ChangeId, Timeline};

/// Changes of one input that are shown as one row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fold {
    /// The first of them, whose row stays.
    pub first: ChangeId,
    /// All of them, in order.
    pub changes: Vec<ChangeId>,
}

/// All chatter among these rows: as long as so many changes follow each other within so short a
/// time as the site says.
pub(super) fn folds(timeline: &Timeline<'_>, rows: &[Row]) -> Vec<Fold> {
    let mut by_input: BTreeMap<(u32, u8), Vec<ChangeId>> = BTreeMap::new();
    for row in rows {
        let ChangeId { event, input } = row.change;
        by_input.entry((event.recorder, input)).or_default().push(row.change);
    }
    let mut folds: Vec<Fold> =
        by_input.values().flat_map(|changes| folds_of(timeline, changes)).collect();
    let places: HashMap<ChangeId, usize> =
        rows.iter().enumerate().map(|(place, row)| (row.change, place)).collect();
    folds.sort_by_key(|fold| places.get(&fold.first).copied());
    folds
}

fn folds_of(timeline: &Timeline<'_>, changes: &[ChangeId]) -> Vec<Fold> {
    let rule = timeline.site().incident.chatter;
    let count = rule.changes as usize;
    let is_dense = |window: &[ChangeId]| match window {
        [first, .., last] => {
            let between = timeline.delta(*first, *last).middle_us();
            between.is_some_and(|between| between <= rule.within_us)
        }
        _ => false,
    };
    let mut folds: Vec<(usize, usize)> = Vec::new();
    for (first, window) in changes.windows(count.max(2)).enumerate() {
        if !is_dense(window) {
            continue;
        }
        let end = first + window.len();
        match folds.last_mut() {
            // It shares changes with the chatter before.
            Some(last) if first < last.1 => last.1 = end,
            _ => folds.push((first, end)),
        }
    }
    folds
        .into_iter()
        .filter_map(|(first, end)| {
            let changes = changes.get(first..end)?.to_vec();
            Some(Fold { first: *changes.first()?, changes })
        })
        .collect()
}
