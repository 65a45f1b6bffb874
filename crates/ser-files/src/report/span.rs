//! Durations as people read them.

/// Microseconds as `12 ms`, `12.3 ms`, `1.250 s`, `2 min 5 s`, `3 h 2 min`: the longer, the coarser.
/// Whole milliseconds have no decimals.
pub(crate) fn duration(us: i64) -> String {
    let sign = if us < 0 { "-" } else { "" };
    let us = us.unsigned_abs();
    let tenths = (us + 50) / 100;
    let text = match us {
        0..999_950 => match tenths % 10 {
            0 => format!("{} ms", tenths / 10),
            tenth => format!("{}.{tenth} ms", tenths / 10),
        },
        999_950..60_000_000 => format!("{}.{:03} s", us / 1_000_000, us / 1000 % 1000),
        60_000_000..3_600_000_000 => format!("{} min {} s", us / 60_000_000, us / 1_000_000 % 60),
        3_600_000_000..86_400_000_000 => {
            format!("{} h {} min", us / 3_600_000_000, us / 60_000_000 % 60)
        }
        _ => format!("{} d {} h", us / 86_400_000_000, us / 3_600_000_000 % 24),
    };
    format!("{sign}{text}")
}

/// Microseconds since something, as a narrow column: `+12.0 ms`, `+1.250 s`, `+2m05.0 s`.
pub(super) fn since(us: i64) -> String {
    let sign = if us < 0 { "-" } else { "+" };
    let us = us.unsigned_abs();
    match us {
        0..999_950 => format!("{sign}{}.{} ms", (us + 50) / 1000, (us + 50) / 100 % 10),
        999_950..60_000_000 => format!("{sign}{}.{:03} s", us / 1_000_000, us / 1000 % 1000),
        60_000_000..3_600_000_000 => {
            let seconds = us / 1_000_000 % 60;
            format!("{sign}{}m{seconds:02}.{} s", us / 60_000_000, us / 100_000 % 10)
        }
        _ => {
            let minutes = us / 60_000_000;
            format!("{sign}{}h{:02}m", minutes / 60, minutes % 60)
        }
    }
}

/// How far the truth may be away, either way: `1.1 ms`; rounded up, never to nothing.
pub(crate) fn doubt(us: i64) -> String {
    let tenths = us.unsigned_abs().div_ceil(100).max(1);
    match tenths {
        0..1000 => format!("{}.{} ms", tenths / 10, tenths % 10),
        1000..10_000 => format!("{} ms", tenths.div_ceil(10)),
        10_000..600_000 => format!("{}.{} s", tenths / 10_000, tenths / 1000 % 10),
        600_000..36_000_000 => format!("{} min", tenths.div_ceil(600_000)),
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
            (10_920_000_000, "+3h02m"),
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
            (1_500_000, "1.5 s"),
            (61_000_000, "2 min"),
        ] {
            assert_eq!(doubt(us), text);
        }
    }
}
