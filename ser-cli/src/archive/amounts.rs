//! For how long, and how much.

use std::time::Duration;

/// A day.
const DAY: Duration = Duration::from_secs(86_400);

/// Days, weeks, or years of 366 days.
pub(crate) fn parse_keep(text: &str) -> Result<Duration, String> {
    let wrong = "not a number of days, weeks or years like 90d, 26w or 5y";
    let units = [('d', 1), ('w', 7), ('y', 366)];
    let unit = units.iter().find_map(|(unit, days)| Some((text.strip_suffix(*unit)?, *days)));
    let (number, days) = unit.ok_or(wrong)?;
    let number: u32 = number.parse().map_err(|_| wrong)?;
    let time = number.checked_mul(days).and_then(|days| DAY.checked_mul(days));
    time.filter(|time| !time.is_zero()).ok_or_else(|| wrong.to_owned())
}

/// Bytes; a megabyte has a million.
pub(crate) fn parse_size(text: &str) -> Result<u64, String> {
    let wrong = "not a size like 500MB or 10GB";
    let units = [("MB", 1_000_000), ("GB", 1_000_000_000), ("TB", 1_000_000_000_000)];
    let unit = units.iter().find_map(|(unit, bytes)| Some((text.strip_suffix(unit)?, *bytes)));
    let (number, bytes) = unit.ok_or(wrong)?;
    let number: u64 = number.parse().map_err(|_| wrong)?;
    number.checked_mul(bytes).filter(|bytes| *bytes > 0).ok_or_else(|| wrong.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_sizes_are_read_with_their_units() {
        assert_eq!(parse_keep("5y"), Ok(5 * 366 * DAY));
        assert_eq!(parse_keep("26w"), Ok(26 * 7 * DAY));
        assert_eq!(parse_size("10GB"), Ok(10_000_000_000));
        for wrong in ["", "5", "y", "-5y", "0d", "5m", "99999999999999y"] {
            assert!(parse_keep(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "10", "GB", "-1GB", "0MB", "1.5GB", "99999999999TB"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
