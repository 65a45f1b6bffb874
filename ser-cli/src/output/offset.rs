//! How far a clock is off, and how long ago something was, as people read it.

/// A clock is so far off because it was never set, or because its zone is another one.
const FAR_US: u64 = 1_000_000;

/// The middle of two ends, and what is open on either side: as `+0.4 ± 0.3 ms`; from a second on as
/// `-3600.000 s ± 6.0 ms`.
pub(crate) fn offset((least_us, most_us): (i64, i64)) -> String {
    let middle = least_us.midpoint(most_us);
    // The ends may be as far apart as numbers go.
    let half_us = most_us.abs_diff(middle).max(middle.abs_diff(least_us));
    let size = middle.unsigned_abs();
    let is_far = size >= FAR_US;
    let rounded = if is_far { size - size % 1000 } else { size.saturating_add(50) / 100 * 100 };
    let sign = if middle < 0 && rounded > 0 { '-' } else { '+' };
    // Rounded up, with what the rounding of the middle takes.
    let tenths = half_us.saturating_add(rounded.abs_diff(size)).div_ceil(100);
    let doubt = format!("± {}.{} ms", tenths / 10, tenths % 10);
    match is_far {
        true => format!("{sign}{}.{:03} s {doubt}", size / 1_000_000, size / 1000 % 1000),
        false => format!("{sign}{}.{} {doubt}", rounded / 1000, rounded / 100 % 10),
    }
}

/// As `45 s`, `12 min`, `3 h 5 min` or `2 d 3 h`.
pub(crate) fn ago(age_s: u32) -> String {
    match (age_s / 86_400, age_s / 3600 % 24, age_s / 60 % 60) {
        (0, 0, 0) => format!("{age_s} s"),
        (0, 0, minutes) => format!("{minutes} min"),
        (0, hours, minutes) => format!("{hours} h {minutes} min"),
        (days, hours, _) => format!("{days} d {hours} h"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_is_rounded_and_its_doubt_rounded_up() {
        for (least, most, text) in [
            (0, 0, "+0.0 ± 0.0 ms"),
            (0, 1, "+0.0 ± 0.1 ms"),
            (100, 700, "+0.4 ± 0.3 ms"),
            (110, 690, "+0.4 ± 0.3 ms"),
            (-700, -100, "-0.4 ± 0.3 ms"),
            (-380, 139, "-0.1 ± 0.3 ms"),
            (-60, 0, "+0.0 ± 0.1 ms"),
            (999_000, 999_800, "+999.4 ± 0.4 ms"),
            (-3_600_006_000, -3_599_994_000, "-3600.000 s ± 6.0 ms"),
            (3_599_999_000, 3_600_001_000, "+3600.000 s ± 1.0 ms"),
            (i64::MIN, i64::MAX, "+0.0 ± 9223372036854775.9 ms"),
        ] {
            assert_eq!(offset((least, most)), text);
        }
    }

    #[test]
    fn a_time_ago_is_as_coarse_as_it_is_long() {
        for (age_s, text) in [
            (0, "0 s"),
            (45, "45 s"),
            (750, "12 min"),
            (3660, "1 h 1 min"),
            (11_100, "3 h 5 min"),
            (183_600, "2 d 3 h"),
        ] {
            assert_eq!(ago(age_s), text);
        }
    }
}
