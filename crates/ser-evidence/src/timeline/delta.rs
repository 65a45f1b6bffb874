//! The time between two changes, and their order.

use super::{ChangeId, EventId, Timeline};
use crate::clock::Home;
use crate::clock::envelope::{NO_HI, NO_LO, Slope, added};
use crate::clock::hosts::HOST_RATE_PPB;
use crate::clock::offsets::{ends, moved};
use crate::site::{Delays, Recorder};
use crate::time::shown;

/// How often a recorder looks at its inputs, in microseconds.
const PERIOD_US: i64 = 1000;

/// Bounds are rounded outwards here and there. So much is moved at either end, in microseconds,
/// that what is said of the order of two entries does not depend on it.
const SLACK_US: i64 = 5;

/// How far the time of a host may be from true time.
/// A share of the host's own time is a little more than that of true time.
const BY_HOST: Slope = Slope::within(HOST_RATE_PPB + HOST_RATE_PPB / 10_000);

/// The time from one change to another, in microseconds; negative if the other came first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delta {
    /// The least; `None` if that is not known.
    pub lo_us: Option<i64>,
    /// The most; `None` if that is not known.
    pub hi_us: Option<i64>,
}

/// What is known of the order of two entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The first one came first.
    Before,
    /// The second one came first.
    After,
    /// They are one sample.
    Same,
    /// Nobody knows.
    Unknown,
}

impl Delta {
    fn of((lo, hi): (i64, i64)) -> Delta {
        Delta { lo_us: (lo != NO_LO).then_some(lo), hi_us: (hi != NO_HI).then_some(hi) }
    }

    /// The middle, if both ends are known.
    #[must_use]
    pub fn middle_us(self) -> Option<i64> {
        Some(self.lo_us?.midpoint(self.hi_us?))
    }

    /// How far the truth may be from the middle, if both ends are known.
    #[must_use]
    pub fn doubt_us(self) -> Option<i64> {
        Some((self.hi_us?.saturating_sub(self.lo_us?) + 1) / 2)
    }
}

impl Timeline<'_> {
    /// What is known of the order of two entries. Inside a life the sequence decides. Between
    /// recorders it takes bounds that do not meet.
    #[must_use]
    pub fn order(&self, one: EventId, other: EventId) -> Order {
        if (one.recorder, one.life) == (other.recorder, other.life) {
            return match one.place.cmp(&other.place) {
                std::cmp::Ordering::Less => Order::Before,
                std::cmp::Ordering::Equal => Order::Same,
                std::cmp::Ordering::Greater => Order::After,
            };
        }
        // A clock that was never set says nothing among others that were, and is listed apart.
        let is_timeless = |event| self.key(event).is_none_or(|key| key.is_timeless);
        if is_timeless(one) != is_timeless(other) {
            return Order::Unknown;
        }
        // A host that gains or loses does not change what came first.
        let (lo, hi) = self.moved_between((one, None), (other, None), Slope::within(0));
        let order = match (lo > 0, hi < 0) {
            (true, false) => Order::Before,
            (false, true) => Order::After,
            _ => return Order::Unknown,
        };
        let is_consistent = || {
            let (lo, hi) = self.moved_between((one, None), (other, None), BY_HOST);
            lo <= hi
        };
        // What contradicts itself proves nothing.
        if lo <= hi || is_consistent() { order } else { Order::Unknown }
    }

    /// Whether recorders may be compared without any scale that both share: by a broadcast or a
    /// contact.
    pub(crate) fn has_links(&self) -> bool {
        !self.model.by_pair.is_empty()
    }

    /// The time from one change to another. From a change to itself it is 0, and so it is between
    /// two that are [one movement](Self::same_movement).
    #[must_use]
    pub fn delta(&self, one: ChangeId, other: ChangeId) -> Delta {
        if one == other || self.same_movement(one) == Some(other) {
            return Delta { lo_us: Some(0), hi_us: Some(0) };
        }
        let seen = |change: ChangeId| [Some(change), self.same_movement(change)];
        let (mut lo, mut hi) = (NO_LO, NO_HI);
        for one in seen(one).into_iter().flatten() {
            for other in seen(other).into_iter().flatten() {
                let sides = ((one.event, Some(one.input)), (other.event, Some(other.input)));
                let between = self.moved_between(sides.0, sides.1, BY_HOST);
                (lo, hi) = (lo.max(between.0), hi.min(between.1));
            }
        }
        // Where a bound is wrong, either may be right.
        Delta::of((lo.min(hi), hi.max(lo)))
    }

    /// How far two movements are apart at least, whichever came first; negative if they may be one.
    pub(super) fn moved_apart(
        &self,
        one: (EventId, Option<u8>),
        other: (EventId, Option<u8>),
    ) -> i64 {
        let (lo, hi) = self.moved_between(one, other, BY_HOST);
        lo.max(hi.saturating_neg())
    }

    /// From the movement of one contact to that of another. `by_host` is how far the time of a host
    /// may be from true time.
    fn moved_between(
        &self,
        one: (EventId, Option<u8>),
        other: (EventId, Option<u8>),
        by_host: Slope,
    ) -> (i64, i64) {
        let samples = self.samples_between(one.0, other.0, by_host);
        let (one_lo, one_hi) = self.delay_ends(one.0, one.1);
        let (other_lo, other_hi) = self.delay_ends(other.0, other.1);
        added(samples, (other_lo - one_hi, other_hi - one_lo))
    }

    /// The earliest and the latest movement, from the sample: of one input, or of any change of
    /// this recorder.
    pub(super) fn delay_ends(&self, event: EventId, input: Option<u8>) -> (i64, i64) {
        let Some(recorder) = self.recorder(event) else { return (0, 0) };
        let is_on = input.and_then(|input| self.held(event)?.state_of(input));
        delay_ends_of(&recorder.recorder, is_on)
    }

    /// From one sample to another, by everything that is known about both.
    fn samples_between(&self, one: EventId, other: EventId, by_host: Slope) -> (i64, i64) {
        let mut known = (NO_LO, NO_HI);
        let mut take = |(lo, hi): (i64, i64)| known = (known.0.max(lo), known.1.min(hi));
        for (home, bound) in self.samples(one) {
            let same = self.samples(other).filter(|(other, _)| *other == home);
            for (_, other) in same {
                let (lo, hi) = difference(bound, other);
                take(match home {
                    Home::Boot(_) => added((lo, hi), (by_host.change(lo).0, by_host.change(hi).1)),
                    Home::Utc => (lo, hi),
                });
            }
        }
        take(difference(ends(self.sample_utc(one)), ends(self.sample_utc(other))));
        if let Some(elapsed) = self.elapsed_between(one, other) {
            take(moved(elapsed, self.shift_us(other) - self.shift_us(one)));
        }
        known
    }

    /// From one sample to another, by the clocks alone: in the same run, or in two that are linked.
    fn elapsed_between(&self, one: EventId, other: EventId) -> Option<(i64, i64)> {
        let run = |event: EventId| self.clock(event)?.sure_run(self.held(event)?);
        let x = |event: EventId, run: usize| {
            let stamp = shown(&self.held(event)?.entry.time)?;
            Some(self.model.runs.get(run)?.unwrapped(stamp))
        };
        let (one_run, other_run) = (run(one)?, run(other)?);
        let (one_x, other_x) = (x(one, one_run)?, x(other, other_run)?);
        if one_run == other_run {
            return Some(self.model.runs.get(one_run)?.elapsed(other_x - one_x));
        }
        let links = &self.model.by_pair;
        links.difference(&self.model.runs, (other_run, other_x), (one_run, one_x))
    }
}

/// The earliest and the latest movement, from the sample: of a contact that closes or opens, or of
/// any.
pub(super) fn delay_ends_of(recorder: &Recorder, is_on: Option<bool>) -> (i64, i64) {
    let Delays { closing_us, opening_us } = recorder.delays;
    let (shortest, longest) = match is_on {
        Some(true) => closing_us,
        Some(false) => opening_us,
        None => (closing_us.0.min(opening_us.0), closing_us.1.max(opening_us.1)),
    };
    // Where in its millisecond an original recorder looks is not known.
    let late = if recorder.is_original { PERIOD_US } else { 0 };
    (-PERIOD_US - i64::from(longest) - SLACK_US, late - i64::from(shortest) + SLACK_US)
}

/// From somewhere in one bound to somewhere in the other.
fn difference(from: (i64, i64), to: (i64, i64)) -> (i64, i64) {
    let lo = if to.0 == NO_LO || from.1 == NO_HI { NO_LO } else { to.0.saturating_sub(from.1) };
    let hi = if to.1 == NO_HI || from.0 == NO_LO { NO_HI } else { to.1.saturating_sub(from.0) };
    (lo, hi)
}
