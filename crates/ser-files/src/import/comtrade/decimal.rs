//! Numbers of a configuration, which devices write with blanks, points and exponents.

/// A number that is not negative.
pub(super) fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let is_number = !text.is_empty()
        && text.len() <= 40
        && text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
    text.parse::<f64>().ok().filter(|number| is_number && number.is_finite() && *number >= 0.0)
}

/// A whole number.
pub(super) fn whole(text: &str) -> Option<u64> {
    let text = text.trim();
    let is_whole = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|_| is_whole)
}

/// Nanoseconds as a whole number, if they are few enough to be reckoned with: thirty years.
pub(super) fn nanoseconds(ns: f64) -> Option<i64> {
    const MOST: f64 = 1e18;
    // Within the range the conversion is exact but for the fraction.
    #[allow(clippy::cast_possible_truncation)]
    (ns.abs() <= MOST).then_some(ns.round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_devices_write_them() {
        assert_eq!(number("1.0 "), Some(1.0));
        assert_eq!(number("1.000000E+00"), Some(1.0));
        assert_eq!(number("1000"), Some(1000.0));
        for wrong in ["", "-1", "inf", "nan", "1e999", "0x1", "1 0"] {
            assert_eq!(number(wrong), None, "{wrong}");
        }
        assert_eq!((whole(" 12 "), whole("+1"), whole("")), (Some(12), None, None));
        assert_eq!(nanoseconds(60_012_000.0 * 1000.0), Some(60_012_000_000));
        assert_eq!(nanoseconds(1e19), None);
    }
}
