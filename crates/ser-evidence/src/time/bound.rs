//! What is known of a moment: the truth lies between two ends.

use std::fmt;
use std::marker::PhantomData;

use super::moment::{Moment, Scale};

/// The truth lies in `[lo, hi]`, ends included. Either end may be unknown: then there is none.
///
/// A bound with `lo` above `hi` is empty. It holds no moment and says that something it was made
/// from is wrong.
pub struct Bound<S> {
    lo: i64,
    hi: i64,
    scale: PhantomData<S>,
}

/// Stands for the missing lower end. No real moment is as early.
const NO_LO: i64 = i64::MIN;

/// Stands for the missing upper end.
const NO_HI: i64 = i64::MAX;

impl<S: Scale> Bound<S> {
    /// Nothing is known.
    pub const UNKNOWN: Bound<S> = Bound { lo: NO_LO, hi: NO_HI, scale: PhantomData };

    /// Between two moments; `None` is no end.
    #[must_use]
    pub fn new(lo: Option<Moment<S>>, hi: Option<Moment<S>>) -> Bound<S> {
        Bound::raw(lo.map_or(NO_LO, Moment::us), hi.map_or(NO_HI, Moment::us))
    }

    /// Between two moments in microseconds.
    #[must_use]
    pub const fn from_us(lo: i64, hi: i64) -> Bound<S> {
        Bound::raw(lo, hi)
    }

    const fn raw(lo: i64, hi: i64) -> Bound<S> {
        Bound { lo, hi, scale: PhantomData }
    }

    /// The lower end, if there is one.
    #[must_use]
    pub fn lo(self) -> Option<Moment<S>> {
        (self.lo != NO_LO).then_some(Moment::from_us(self.lo))
    }

    /// The upper end, if there is one.
    #[must_use]
    pub fn hi(self) -> Option<Moment<S>> {
        (self.hi != NO_HI).then_some(Moment::from_us(self.hi))
    }

    /// Whether both ends are known.
    #[must_use]
    pub const fn is_known(self) -> bool {
        self.lo != NO_LO && self.hi != NO_HI
    }

    /// Whether no moment is in it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.lo > self.hi
    }

    /// Whether this moment is in it.
    #[must_use]
    pub fn contains(self, moment: Moment<S>) -> bool {
        self.lo <= moment.us() && moment.us() <= self.hi
    }

    /// The middle, if both ends are known.
    #[must_use]
    pub fn middle(self) -> Option<Moment<S>> {
        self.is_known().then(|| Moment::from_us(self.lo.midpoint(self.hi)))
    }

    /// From end to end in microseconds, if both are known.
    #[must_use]
    pub const fn width_us(self) -> Option<i64> {
        if self.is_known() { Some(self.hi.saturating_sub(self.lo)) } else { None }
    }

    /// Whether everything in this bound is before everything in `other`.
    #[must_use]
    pub const fn is_before(self, other: Bound<S>) -> bool {
        self.hi < other.lo
    }

    /// What is in both.
    #[must_use]
    pub fn intersection(self, other: Bound<S>) -> Bound<S> {
        Bound::raw(self.lo.max(other.lo), self.hi.min(other.hi))
    }

    /// The smallest bound that has everything of both.
    #[must_use]
    pub fn hull(self, other: Bound<S>) -> Bound<S> {
        Bound::raw(self.lo.min(other.lo), self.hi.max(other.hi))
    }

    /// Everything between `lo` and `hi` microseconds after this bound. An unknown end stays
    /// unknown.
    #[must_use]
    pub fn shifted(self, lo_us: i64, hi_us: i64) -> Bound<S> {
        self.moved_to(lo_us, hi_us)
    }

    /// The same on another scale, whose zero is `lo` to `hi` microseconds before this scale's.
    /// An unknown end stays unknown.
    #[must_use]
    pub fn moved_to<T: Scale>(self, lo_us: i64, hi_us: i64) -> Bound<T> {
        let lo = if self.lo == NO_LO || lo_us == NO_LO {
            NO_LO
        } else {
            self.lo.saturating_add(lo_us).max(NO_LO + 1)
        };
        let hi = if self.hi == NO_HI || hi_us == NO_HI {
            NO_HI
        } else {
            self.hi.saturating_add(hi_us).min(NO_HI - 1)
        };
        Bound::raw(lo, hi)
    }
}

impl<S> Clone for Bound<S> {
    fn clone(&self) -> Bound<S> {
        *self
    }
}

impl<S> Copy for Bound<S> {}

impl<S> PartialEq for Bound<S> {
    fn eq(&self, other: &Bound<S>) -> bool {
        (self.lo, self.hi) == (other.lo, other.hi)
    }
}

impl<S> Eq for Bound<S> {}

/// As `[1, 5] us (UTC)`, with `-` for an unknown end.
impl<S: Scale> fmt::Debug for Bound<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |end: Option<Moment<S>>| end.map_or("-".to_owned(), |end| end.us().to_string());
        write!(f, "[{}, {}] us ({})", end(self.lo()), end(self.hi()), S::NAME)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Utc;

    type B = Bound<Utc>;

    #[test]
    fn before_means_that_no_moment_is_shared() {
        assert!(B::from_us(1, 4).is_before(B::from_us(5, 9)));
        assert!(!B::from_us(1, 5).is_before(B::from_us(5, 9)));
        assert!(!B::UNKNOWN.is_before(B::from_us(5, 9)));
        assert!(!B::from_us(5, 9).is_before(B::UNKNOWN));
    }

    #[test]
    fn an_unknown_end_stays_unknown() {
        let known_until = B::new(None, Some(Moment::from_us(9)));
        assert_eq!(known_until.shifted(-3, 3), B::new(None, Some(Moment::from_us(12))));
        assert_eq!(B::UNKNOWN.shifted(5, 5), B::UNKNOWN);
        assert_eq!(known_until.middle(), None);
        assert_eq!(known_until.width_us(), None);
        assert_eq!(B::from_us(2, 8).middle(), Some(Moment::from_us(5)));
    }

    #[test]
    fn two_bounds_without_a_common_moment_have_an_empty_intersection() {
        assert!(B::from_us(1, 4).intersection(B::from_us(5, 9)).is_empty());
        assert!(!B::from_us(1, 5).intersection(B::from_us(5, 9)).is_empty());
        assert_eq!(B::from_us(1, 4).hull(B::from_us(6, 9)), B::from_us(1, 9));
    }
}
