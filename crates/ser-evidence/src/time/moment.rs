//! Moments on a scale.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;

/// A scale of time. Moments on different scales have nothing to do with each other.
pub trait Scale: 'static {
    /// The name of the scale, for people who debug.
    const NAME: &'static str;
}

/// What a recorder's clock shows: microseconds since it would have shown the beginning of 1970. The
/// clock has no time zone, is set by people, and drifts.
#[derive(Debug)]
pub enum Shown {}

/// A host's monotonic clock: microseconds since it was booted, time asleep included. Readings of
/// two boots have nothing to do with each other; the boot stands beside them.
#[derive(Debug)]
pub enum Host {}

/// Coordinated Universal Time: microseconds since the beginning of 1970, without leap seconds.
#[derive(Debug)]
pub enum Utc {}

impl Scale for Shown {
    const NAME: &'static str = "shown";
}

impl Scale for Host {
    const NAME: &'static str = "host";
}

impl Scale for Utc {
    const NAME: &'static str = "UTC";
}

/// A moment on a scale, in microseconds.
///
/// Moments on different scales cannot be subtracted:
///
/// ```compile_fail
/// use ser_evidence::time::{Moment, Shown, Utc};
/// let difference_us = Moment::<Utc>::from_us(2).since(Moment::<Shown>::from_us(1));
/// ```
pub struct Moment<S> {
    us: i64,
    scale: PhantomData<S>,
}

impl<S: Scale> Moment<S> {
    /// The moment this many microseconds after the scale's beginning.
    #[must_use]
    pub const fn from_us(us: i64) -> Moment<S> {
        Moment { us, scale: PhantomData }
    }

    /// Microseconds since the scale's beginning.
    #[must_use]
    pub const fn us(self) -> i64 {
        self.us
    }

    /// Microseconds from `earlier` to this moment; negative if it is later.
    #[must_use]
    pub const fn since(self, earlier: Moment<S>) -> i64 {
        self.us.saturating_sub(earlier.us)
    }

    /// The moment `us` microseconds later.
    #[must_use]
    pub const fn after(self, us: i64) -> Moment<S> {
        Moment::from_us(self.us.saturating_add(us))
    }
}

impl<S> Clone for Moment<S> {
    fn clone(&self) -> Moment<S> {
        *self
    }
}

impl<S> Copy for Moment<S> {}

impl<S> PartialEq for Moment<S> {
    fn eq(&self, other: &Moment<S>) -> bool {
        self.us == other.us
    }
}

impl<S> Eq for Moment<S> {}

impl<S> PartialOrd for Moment<S> {
    fn partial_cmp(&self, other: &Moment<S>) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<S> Ord for Moment<S> {
    fn cmp(&self, other: &Moment<S>) -> Ordering {
        self.us.cmp(&other.us)
    }
}

impl<S> Hash for Moment<S> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.us.hash(state);
    }
}

/// As `1764500000000000 us (UTC)`.
impl<S: Scale> fmt::Debug for Moment<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} us ({})", self.us, S::NAME)
    }
}
