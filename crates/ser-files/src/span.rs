//! Durations as people read them.

/// Microseconds as `12 ms`, `12.3 ms`, `1.250 s`, `2 min 5 s`, `3 h 2 min`: the longer, the
/// coarser. Whole milliseconds have no decimals.
pub(crate) fn duration(us: i64) -> String {
    let sign = if us < 0 { "-" } else { "" };
    let us = us.unsigned_abs();
    let (tenths, ms, seconds, minutes, hours) = (
        rounded(us, 100),
        rounded(us, 1_000),
        rounded(us, 1_000_000),
        rounded(us, 60_000_000),
        rounded(us, 3_600_000_000),
    );
    let text = match us {
        0..999_950 => match tenths % 10 {
            0 => format!("{} ms", tenths / 10),
            tenth => format!("{}.{tenth} ms", tenths / 10),
        },
        999_950..59_999_500 => format!("{}.{:03} s", ms / 1000, ms % 1000),
        59_999_500..3_599_500_000 => format!("{} min {} s", seconds / 60, seconds % 60),
        3_599_500_000..86_370_000_000 => format!("{} h {} min", minutes / 60, minutes % 60),
        _ => format!("{} d {} h", hours / 24, hours % 24),
    };
    format!("{sign}{text}")
}

/// Microseconds since something, as a narrow column: `+12.0 ms`, `+1.250 s`, `+2m05.0 s`.
pub(crate) fn since(us: i64) -> String {
    let sign = if us < 0 { "-" } else { "+" };
    let us = us.unsigned_abs();
    let (tenths_of_ms, ms, tenths) = (rounded(us, 100), rounded(us, 1_000), rounded(us, 100_000));
    match us {
        0..999_950 => format!("{sign}{}.{} ms", tenths_of_ms / 10, tenths_of_ms % 10),
        999_950..59_999_500 => format!("{sign}{}.{:03} s", ms / 1000, ms % 1000),
        59_999_500..3_599_950_000 => {
            let (minutes, tenths) = (tenths / 600, tenths % 600);
            format!("{sign}{minutes}m{:02}.{} s", tenths / 10, tenths % 10)
        }
        _ => {
            let minutes = rounded(us, 60_000_000);
            format!("{sign}{}h{:02}m", minutes / 60, minutes % 60)
        }
    }
}

/// A number of units, to the nearest one.
const fn rounded(us: u64, unit_us: u64) -> u64 {
    us.saturating_add(unit_us / 2) / unit_us
}

/// How far the truth may be away, either way: `1.1 ms`; rounded up, never to nothing.
pub(crate) fn doubt(us: i64) -> String {
    let tenths = us.unsigned_abs().div_ceil(100).max(1);
    match tenths {
        0..1000 => format!("{}.{} ms", tenths / 10, tenths % 10),
        1000..10_000 => format!("{} ms", tenths.div_ceil(10)),
        10_000..599_001 => {
            let tenths_of_s = tenths.div_ceil(1000);
            format!("{}.{} s", tenths_of_s / 10, tenths_of_s % 10)
        }
        599_001..35_400_001 => format!("{} min", tenths.div_ceil(600_000)),
        _ => format!("{} h", tenths.div_ceil(36_000_000)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_as_fine_as_it_is_short() {
        for (us, text) in [
            (0, "0 ms"),
            (12_000, "12 ms"),
            (12_340, "12.3 ms"),
            (-41_500, "-41.5 ms"),
            (1_250_000, "1.250 s"),
            (125_000_000, "2 min 5 s"),
            (10_920_000_000, "3 h 2 min"),
            (3_599_700_000, "1 h 0 min"),
            (86_399_000_000, "1 d 0 h"),
            (266_400_000_000, "3 d 2 h"),
        ] {
            assert_eq!(duration(us), text);
        }
    }

    #[test]
    fn time_since_the_first_change_is_a_narrow_column() {
        for (us, text) in [
            (0, "+0.0 ms"),
            (12_000, "+12.0 ms"),
            (-1_260, "-1.3 ms"),
            (1_250_000, "+1.250 s"),
            (125_400_000, "+2m05.4 s"),
            (59_999_900, "+1m00.0 s"),
            (3_599_990_000, "+1h00m"),
            (10_920_000_000, "+3h02m"),
            (172_799_900_000, "+48h00m"),
        ] {
            assert_eq!(since(us), text);
        }
    }

    #[test]
    fn doubt_is_never_rounded_down_nor_to_nothing() {
        for (us, text) in [
            (0, "0.1 ms"),
            (1_001, "1.1 ms"),
            (99_900, "99.9 ms"),
            (123_400, "124 ms"),
            (999_901, "1.0 s"),
            (1_500_000, "1.5 s"),
            (1_500_001, "1.6 s"),
            (59_900_001, "1 min"),
            (61_000_000, "2 min"),
            (3_540_000_001, "1 h"),
        ] {
            assert_eq!(doubt(us), text);
        }
    }
}
