//! Numbers of entries as ranges: what was told to be missing, and what is let go.

use std::collections::BTreeMap;

/// Some of the numbers of a life, as ranges that neither touch nor overlap: by the first, the last.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Numbers(BTreeMap<u64, u64>);

impl Numbers {
    /// Adds a range; the last is not before the first.
    pub(crate) fn add(&mut self, mut first: u64, mut last: u64) {
        while let Some((&from, &to)) = self.0.range(..=last.saturating_add(1)).next_back()
            && to.saturating_add(1) >= first
        {
            self.0.remove(&from);
            (first, last) = (first.min(from), last.max(to));
        }
        self.0.insert(first, last);
    }

    /// How many there are among these.
    pub(crate) fn count(&self, first: u64, last: u64) -> u64 {
        let reaching = self.0.range(..=last).rev();
        let within = reaching.take_while(|&(_, &to)| to >= first);
        within.map(|(&from, &to)| to.min(last) - from.max(first) + 1).sum()
    }

    /// The range in which a number is.
    pub(crate) fn around(&self, number: u64) -> Option<(u64, u64)> {
        let (&first, &last) = self.0.range(..=number).next_back()?;
        (number <= last).then_some((first, last))
    }

    /// First and last of each range.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = (u64, u64)> {
        self.0.iter().map(|(&first, &last)| (first, last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_touch_are_one() {
        let mut numbers = Numbers::default();
        for (first, last) in [(10, 12), (20, 25), (5, 5), (14, 14), (13, 13), (22, 23), (4, 4)] {
            numbers.add(first, last);
        }
        let ranges: Vec<_> = numbers.ranges().collect();
        assert_eq!(ranges, [(4, 5), (10, 14), (20, 25)]);
        assert_eq!((numbers.count(1, 30), numbers.count(5, 21), numbers.count(6, 9)), (13, 8, 0));
        assert_eq!((numbers.around(12), numbers.around(15)), (Some((10, 14)), None));
        numbers.add(1, u64::MAX);
        assert_eq!(numbers.ranges().collect::<Vec<_>>(), [(1, u64::MAX)]);
    }
}
