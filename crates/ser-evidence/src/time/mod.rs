//! Moments, durations and bounds in whole microseconds, each on a named scale.
//!
//! A moment that a recorder's clock showed, one that a host observed and one in UTC are different
//! types, so they cannot be compared or subtracted by mistake. What is not known exactly is a
//! [`Bound`]: the truth lies in it, ends included.

mod bound;
mod calendar;
mod moment;

pub use bound::Bound;
pub use calendar::{AROUND_2069_US, CENTURY_US, shown, stamp};
pub use moment::{Host, Moment, Scale, Shown, Utc};
