//! True time: picoseconds since the world began. A millisecond that is off by one part per billion
//! is off by one picosecond, so clocks that drift need no rounding.

/// Picoseconds since the world began.
pub(crate) type Ps = i64;

/// A microsecond.
pub(crate) const US: Ps = 1_000_000;
/// A millisecond.
pub(crate) const MS: Ps = 1000 * US;
/// A second.
pub(crate) const S: Ps = 1000 * MS;

/// The last whole microsecond before.
pub(crate) fn floor_us(time: Ps) -> i64 {
    time.div_euclid(US)
}

/// The first whole microsecond after.
pub(crate) fn ceil_us(time: Ps) -> i64 {
    -(-time).div_euclid(US)
}
