//! How late the capture interrupt comes: from the moment its timer expires to the first instruction
//! of its handler.
//!
//! The timer expires every millisecond, which is a fixed number of instructions. The earliest
//! interrupt of a board's life comes at once and shows [when the timer expires](expiry). Any other
//! interrupt is late by as much as it comes later within its millisecond. In a time in which all
//! interrupts are late, they must be measured by those of another time.

use std::fmt;

/// Upper bounds of the histogram's rows, in instructions, inclusive.
const ROWS: [u64; 7] = [0, 10, 30, 100, 300, 1_000, 3_000];

/// The length of the longest bar.
const BAR: u64 = 40;

/// Instructions from expiry to handler, of many interrupts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    /// In ascending order.
    sorted: Vec<u64>,
}

/// When the timer expires within its period, judging by the earliest of these beginnings of the
/// handler.
#[must_use]
pub fn expiry(began: &[u64], period: u64) -> u64 {
    let Some(&first) = began.first() else { return 0 };
    // Compared within half a period of the first beginning, because that one may have been late
    // itself.
    let half = period / 2;
    let earliest = began.iter().map(|&began| (began - first + half) % period).min().unwrap_or(half);
    (first + period - half + earliest) % period
}

impl Lateness {
    /// From the count of instructions at each beginning of the handler, from when the timer expires
    /// within its period, and from the period.
    #[must_use]
    pub fn of(began: &[u64], expiry: u64, period: u64) -> Lateness {
        let mut sorted: Vec<u64> =
            began.iter().map(|&began| (began + period - expiry) % period).collect();
        sorted.sort_unstable();
        Lateness { sorted }
    }

    /// How many interrupts there were.
    #[must_use]
    pub fn count(&self) -> usize {
        self.sorted.len()
    }

    /// The lateness that this many of a thousand do not exceed. For 0, the smallest lateness.
    #[must_use]
    pub fn per_mille(&self, per_mille: usize) -> u64 {
        let rank = (self.sorted.len() * per_mille).div_ceil(1000).max(1);
        self.sorted.get(rank - 1).copied().unwrap_or_default()
    }

    /// The largest.
    #[must_use]
    pub fn max(&self) -> u64 {
        self.per_mille(1000)
    }

    /// The rows of a histogram: bounds, and how many interrupts are within.
    fn rows(&self) -> impl Iterator<Item = (u64, u64, u64)> {
        let ends = ROWS.into_iter().chain([u64::MAX]);
        let begins = [0].into_iter().chain(ROWS.into_iter().map(|end| end + 1));
        begins.zip(ends).map(|(begin, end)| {
            let up_to = |bound| self.sorted.partition_point(|&late| late <= bound);
            let below = begin.checked_sub(1).map_or(0, up_to);
            (begin, end, (up_to(end) - below) as u64)
        })
    }
}

impl fmt::Display for Lateness {
    /// A histogram, without the empty rows after the last one that counts.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let most = self.rows().map(|(_, _, count)| count).max().unwrap_or(0).max(1);
        let max = self.max();
        for (begin, end, count) in self.rows().filter(|&(begin, _, _)| begin <= max) {
            let range = match (begin, end) {
                (begin, end) if begin == end => format!("{begin}"),
                (begin, u64::MAX) => format!("from {begin}"),
                (begin, end) => format!("{begin}–{end}"),
            };
            let bar = (count * BAR).div_ceil(most);
            let bar = "█".repeat(usize::try_from(bar).unwrap_or_default());
            writeln!(f, "  {range:>16}  {count:>7}  {bar}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earliest_shows_the_expiry_even_if_the_first_was_late() {
        let began = [1_007, 2_000, 3_400, 4_001];
        assert_eq!(expiry(&began, 1_000), 0);
        assert_eq!(Lateness::of(&began, 0, 1_000).sorted, [0, 1, 7, 400]);
        // The result is the same where the period begins within the spread of the beginnings.
        let began = began.map(|began| began + 998);
        assert_eq!(expiry(&began, 1_000), 998);
        assert_eq!(Lateness::of(&began, 998, 1_000).sorted, [0, 1, 7, 400]);
        assert_eq!(expiry(&[], 1_000), 0);
    }

    #[test]
    fn a_delay_that_all_have_shows_against_others() {
        let (quiet, busy) = ([1_100, 2_100], [3_105, 4_105]);
        let expiry = expiry(&[quiet, busy].concat(), 1_000);
        let [quiet, busy] = [quiet, busy].map(|began| Lateness::of(&began, expiry, 1_000).sorted);
        assert_eq!((quiet, busy), (vec![0, 0], vec![5, 5]));
    }

    #[test]
    fn ranks_are_those_of_the_sorted_list() {
        let began: Vec<u64> = (0..1000).map(|index| index * 1_000 + index / 10).collect();
        let lateness = Lateness::of(&began, 0, 1_000);
        let ranks = [1, 500, 990, 999, 1000].map(|per_mille| lateness.per_mille(per_mille));
        assert_eq!((lateness.count(), ranks), (1000, [0, 49, 98, 99, 99]));
        assert_eq!(Lateness::default().max(), 0);
    }

    #[test]
    fn the_histogram_ends_with_the_largest() {
        let lateness = Lateness { sorted: vec![0, 0, 0, 11] };
        let lines = ["               0        3  ".to_owned() + &"█".repeat(40)];
        let text = lateness.to_string();
        assert!(text.starts_with(&format!("  {}\n", lines[0])), "{text}");
        assert!(
            text.ends_with(&format!("           11–30        1  {}\n", "█".repeat(14))),
            "{text}"
        );
        assert_eq!(text.lines().count(), 3);
    }
}
