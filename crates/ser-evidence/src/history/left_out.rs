//! Entries that exist and were not asked for.

use std::collections::BTreeMap;

use super::LifeHistory;
use crate::record::Life;

/// Between which sequences entries were left out.
#[derive(Clone, Debug, Default)]
pub(super) struct LeftOut {
    by_place: BTreeMap<(Life, u64), u64>,
}

impl LeftOut {
    /// Entries between these two were left out.
    pub(super) fn add(&mut self, life: Life, after: u64, before: u64) {
        let known = self.by_place.entry((life, after)).or_default();
        *known = before.max(*known);
    }

    /// Takes what another one has.
    pub(super) fn merge(&mut self, other: LeftOut) {
        other
            .by_place
            .into_iter()
            .for_each(|((life, after), before)| self.add(life, after, before));
    }

    /// Whether everything between these two was left out.
    pub(super) fn holds(&self, life: Life, after: u64, before: u64) -> bool {
        let earlier = self.by_place.range((life, 0)..=(life, after)).next_back();
        earlier.is_some_and(|(_, &end)| end >= before)
    }

    /// Ahead of which places of a life entries were left out.
    pub(super) fn places(&self, life: &LifeHistory) -> Vec<usize> {
        if self.by_place.is_empty() {
            return Vec::new();
        }
        let name = life.name();
        let pairs = life.entries.iter().zip(life.entries.iter().skip(1));
        let is_left_out = |&(_, (one, next)): &(usize, (&super::Held, &super::Held))| {
            next.sequence > one.sequence + 1 && self.holds(name, one.sequence, next.sequence)
        };
        (1..).zip(pairs).filter(is_left_out).map(|(place, _)| place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_between_was_left_out_and_what_reaches_beyond_was_not() {
        let life = Life::from_bits(7);
        let mut left_out = LeftOut::default();
        left_out.add(life, 10, 20);
        let mut more = LeftOut::default();
        more.add(life, 10, 15);
        more.add(life, 30, 40);
        left_out.merge(more);
        for (after, before, is_in) in
            [(10, 20, true), (12, 18, true), (9, 20, false), (10, 21, false), (20, 30, false)]
        {
            assert_eq!(left_out.holds(life, after, before), is_in, "{after}..{before}");
        }
        assert!(!left_out.holds(Life::from_bits(8), 10, 20));
    }
}
