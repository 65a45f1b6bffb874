//! Brackets around rows whose order is not known.
//!
//! Two rows whose order is not proven are in one bracket, with everything between them. So what is
//! in different brackets, or in none, is in proven order. In a long bracket some rows are in order
//! with both their neighbours, and only others may belong before or after them: these rows are
//! [`Sign::Passed`].

use ser_evidence::incident::Row;
use ser_evidence::timeline::{Order, Timeline};

use super::span::doubt;

/// Where a line stands in a bracket.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Sign {
    #[default]
    None,
    First,
    Inner,
    /// Inside, and in proven order with the rows right before and after it.
    Passed,
    Last,
}

impl Sign {
    /// Of what stands right below a line, before the next one.
    pub(super) const fn below(self) -> Sign {
        match self {
            Sign::First | Sign::Inner => Sign::Inner,
            Sign::Passed => Sign::Passed,
            Sign::None | Sign::Last => Sign::None,
        }
    }

    /// Of what stands right above a line, after the one before.
    pub(super) const fn above(self) -> Sign {
        match self {
            Sign::Inner | Sign::Last => Sign::Inner,
            Sign::Passed => Sign::Passed,
            Sign::None | Sign::First => Sign::None,
        }
    }
}

/// Where a row stands among those whose order is not known.
#[derive(Clone, Debug, Default)]
pub(super) struct Bracket {
    pub(super) sign: Sign,
    /// At the end of one: what is said about it.
    pub(super) note: Option<String>,
}

/// A search for a row of unknown order ends when it has met so many rows of other logs that are
/// proven to be earlier: the list is sorted, so those beyond are earlier still.
const ENOUGH_ORDERED: usize = 16;

/// So many rows of the same log are passed over to see whether something before them is in doubt.
const MOST_AHEAD: usize = 256;

/// Brackets with more rows than this are not compared row by row with all others of them.
const EACH_WITH_EACH: usize = 256;

/// A row whose order to so many others is unknown has no width that would help anybody.
const MOST_UNKNOWN: usize = 256;

/// Rows that belong together, by their places in the list.
#[derive(Clone, Copy, Debug)]
struct Span {
    first: usize,
    last: usize,
    /// The row that the last one was found to be unordered with. Most often it is in doubt with the
    /// next one, too.
    witness: usize,
}

/// For each row where it stands.
pub(super) fn brackets(timeline: &Timeline<'_>, rows: &[&Row]) -> Vec<Bracket> {
    let rows = Rows { timeline, rows };
    let mut brackets = vec![Bracket::default(); rows.rows.len()];
    for span in rows.spans().iter().filter(|span| span.first < span.last) {
        for place in span.first..=span.last {
            let Some(bracket) = brackets.get_mut(place) else { continue };
            bracket.sign = match place {
                place if place == span.first => Sign::First,
                place if place == span.last => Sign::Last,
                place if rows.is_passed(place) => Sign::Passed,
                _ => Sign::Inner,
            };
            bracket.note = (place == span.last).then(|| rows.note(span));
        }
    }
    brackets
}

struct Rows<'a> {
    timeline: &'a Timeline<'a>,
    rows: &'a [&'a Row],
}

impl Rows<'_> {
    fn spans(&self) -> Vec<Span> {
        let mut spans: Vec<Span> = Vec::new();
        for place in 0..self.rows.len() {
            let mut span = Span { first: place, last: place, witness: place };
            let mut joined = spans.len();
            for (index, before) in spans.iter().enumerate().rev().take(MOST_AHEAD) {
                if let Some(witness) = self.unordered_with(before, place) {
                    (span.first, span.witness, joined) = (before.first, witness, index);
                } else if !(before.first == before.last && self.is_one_log(before.first, place)) {
                    break;
                }
            }
            spans.truncate(joined);
            spans.push(span);
        }
        spans
    }

    /// A row of a span whose order to this one, which comes later in the list, is not known.
    fn unordered_with(&self, span: &Span, place: usize) -> Option<usize> {
        if self.is_unknown(span.witness, place) {
            return Some(span.witness);
        }
        let mut ordered = 0;
        for before in (span.first..=span.last).rev() {
            if self.is_one_log(before, place) {
                continue;
            }
            if self.is_unknown(before, place) {
                return Some(before);
            }
            ordered += 1;
            if ordered == ENOUGH_ORDERED {
                break;
            }
        }
        None
    }

    fn is_one_log(&self, one: usize, other: usize) -> bool {
        let log = |place: usize| {
            self.rows.get(place).map(|row| (row.change.event.recorder, row.change.event.life))
        };
        log(one) == log(other)
    }

    fn is_unknown(&self, one: usize, other: usize) -> bool {
        let (Some(one), Some(other)) = (self.rows.get(one), self.rows.get(other)) else {
            return false;
        };
        self.timeline.order(one.change.event, other.change.event) == Order::Unknown
    }

    /// Whether a row is in order with those right before and after it.
    fn is_passed(&self, place: usize) -> bool {
        let before = place.checked_sub(1).is_some_and(|before| self.is_unknown(before, place));
        !before && !self.is_unknown(place, place + 1)
    }

    /// How far apart the truth of rows of unknown order may be.
    fn note(&self, span: &Span) -> String {
        if let Some([one, other]) = self.rows.get(span.first..=span.last)
            && self.timeline.same_movement(one.change) == Some(other.change)
        {
            return "the same contact on both".to_owned();
        }
        let (mut widest, mut is_all) = (0, true);
        for one in span.first..=span.last {
            match self.widest(one, span.last, &mut is_all) {
                Some(us) => widest = widest.max(us),
                None => return "order not known".to_owned(),
            }
        }
        match is_all {
            true => format!("order unknown within {}", doubt(widest)),
            false => format!("order unknown of rows within {} of each other", doubt(widest)),
        }
    }

    /// The widest doubt between a row and those after it up to a last one, in microseconds; `None`
    /// if it has no end. `is_all` becomes false if the order to one of them is proven.
    fn widest(&self, one: usize, last: usize, is_all: &mut bool) -> Option<i64> {
        let is_long = last - one > EACH_WITH_EACH;
        let (mut widest, mut ordered, mut unknown) = (0, 0, 0);
        for other in (one + 1..=last).filter(|&other| !self.is_one_log(one, other)) {
            if !self.is_unknown(one, other) {
                *is_all = false;
                ordered += 1;
                if is_long && ordered == ENOUGH_ORDERED {
                    break;
                }
                continue;
            }
            unknown += 1;
            let changes = self.rows.get(one).zip(self.rows.get(other));
            let delta =
                changes.map(|(one, other)| self.timeline.delta(one.change, other.change))?;
            widest = widest.max(delta.lo_us?.abs()).max(delta.hi_us?.abs());
            if unknown > MOST_UNKNOWN {
                return None;
            }
        }
        Some(widest)
    }
}
