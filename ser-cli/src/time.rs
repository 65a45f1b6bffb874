//! Times as people write them, and the time between two events.

use std::fmt;

use chrono::{Local, NaiveDateTime, TimeDelta, Timelike};
use ser_proto::TimeStamp;

const FORMATS: [&str; 4] =
    ["%Y-%m-%dT%H:%M:%S%.f", "%Y-%m-%d %H:%M:%S%.f", "%Y-%m-%dT%H:%M", "%Y-%m-%d %H:%M"];

/// Understands `2026-11-22T10:00:00.250`, also with a blank in place of the `T`, without fraction
/// or without seconds.
pub(crate) fn parse_time(text: &str) -> Result<TimeStamp, String> {
    if text.ends_with(['Z', 'z']) || text.get(19..).is_some_and(|tail| tail.contains(['+', '-'])) {
        return Err("a recorder's clock has no time zone: give the local time without Z or offset"
            .to_string());
    }
    let time = FORMATS
        .iter()
        .find_map(|format| NaiveDateTime::parse_from_str(text, format).ok())
        .ok_or("not a date and time like 2026-11-22T10:00:00.250")?;
    if time.nanosecond() >= 1_000_000_000 {
        return Err("a recorder's clock has no second 60".to_string());
    }
    if time.nanosecond() % 1_000_000 != 0 {
        return Err(
            "a recorder's clock has milliseconds, not finer: give up to three decimals".to_string()
        );
    }
    stamp(time).map_err(|year| format!("a recorder's clock runs from 1970 to 2069, not in {year}"))
}

/// The stamp of a calendar time. An error with its year if the two digits of a stamp cannot express
/// it.
pub(crate) fn stamp(time: NaiveDateTime) -> Result<TimeStamp, i32> {
    TimeStamp::try_from(time).map_err(|_| chrono::Datelike::year(&time))
}

/// The local time `ahead` from now, as a recorder's clock would show it.
pub(crate) fn local_time_in(ahead: std::time::Duration) -> Result<TimeStamp, i32> {
    let ahead = TimeDelta::from_std(ahead).unwrap_or_default();
    stamp((Local::now() + ahead).naive_local())
}

/// The local time, written as a stamp is.
pub(crate) fn local_now() -> impl fmt::Display {
    Local::now().format("%Y-%m-%dT%H:%M:%S%.3f")
}

/// The time `elapsed` after `time`, which is a date. Past the year 2069 the time stays the same.
pub(crate) fn time_after(time: TimeStamp, elapsed: std::time::Duration) -> TimeStamp {
    let elapsed = TimeDelta::from_std(elapsed).unwrap_or_default();
    NaiveDateTime::try_from(time).map_or(time, |start| stamp(start + elapsed).unwrap_or(time))
}

/// Milliseconds of the hundred years that two digits can express, 1970–2069.
const CENTURY_MS: i64 = 36_525 * 86_400_000;

/// The most that two stamps differ on either side of the end of 2069, where the two digits of the
/// year begin again: ten years. With a larger difference, a clock was set.
const AROUND_2069_MS: i64 = 10 * 366 * 86_400_000;

/// The time between two events, with its sign. 2069 is followed by 1970.
///
/// As `+0.001 s`, `+1m02.003 s`, `+3h01m02 s`, `+2d03h01m`: the longer, the coarser, so that it is
/// easy to read and fits a narrow column. The times themselves always show the millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Delta {
    ms: i64,
}

impl Delta {
    /// So many milliseconds.
    #[cfg(unix)]
    pub(crate) const fn of_ms(ms: i64) -> Delta {
        Delta { ms }
    }

    /// From `earlier` to `later`; `None` when one of them is no date.
    pub(crate) fn between(earlier: TimeStamp, later: TimeStamp) -> Option<Delta> {
        let straight_ms = straight_ms(earlier, later)?;
        let around_ms = straight_ms - straight_ms.signum() * CENTURY_MS;
        Some(Delta { ms: if around_ms.abs() <= AROUND_2069_MS { around_ms } else { straight_ms } })
    }
}

/// From `earlier` to `later`, by their years as written.
fn straight_ms(earlier: TimeStamp, later: TimeStamp) -> Option<i64> {
    let earlier = NaiveDateTime::try_from(earlier).ok()?;
    let later = NaiveDateTime::try_from(later).ok()?;
    Some((later - earlier).num_milliseconds())
}

/// How a recorder's clock went from one event to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ClockStep {
    /// Forward, as time does.
    Forward,
    /// The clock was set back in between.
    Back,
    /// From 2069 to 1970: the two digits of the year began again.
    YearsBeganAnew,
}

impl fmt::Display for ClockStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ClockStep::Back => "the clock went back",
            ClockStep::YearsBeganAnew => "the two-digit year began anew after 2069",
            ClockStep::Forward => "the clock went on",
        })
    }
}

impl ClockStep {
    /// From `earlier` to `later`; `None` when one of them is no date.
    pub(crate) fn between(earlier: TimeStamp, later: TimeStamp) -> Option<ClockStep> {
        let Delta { ms } = Delta::between(earlier, later)?;
        Some(match straight_ms(earlier, later)? {
            _ if ms < 0 => ClockStep::Back,
            straight if straight < 0 => ClockStep::YearsBeganAnew,
            _ => ClockStep::Forward,
        })
    }
}

impl fmt::Display for Delta {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.ms < 0 { '-' } else { '+' };
        let ms = self.ms.unsigned_abs();
        let (seconds, minutes, hours, days) =
            (ms / 1000 % 60, ms / 60_000 % 60, ms / 3_600_000 % 24, ms / 86_400_000);
        let ms = ms % 1000;
        let text = match (days, hours, minutes) {
            (0, 0, 0) => format!("{sign}{seconds}.{ms:03} s"),
            (0, 0, _) => format!("{sign}{minutes}m{seconds:02}.{ms:03} s"),
            (0, _, _) => format!("{sign}{hours}h{minutes:02}m{seconds:02} s"),
            _ => format!("{sign}{days}d{hours:02}h{minutes:02}m"),
        };
        f.pad(&text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_local_time_ahead_is_the_one_that_this_computer_will_show_then() {
        for ahead in [std::time::Duration::ZERO, std::time::Duration::from_millis(23_456)] {
            let now = || (Local::now() + TimeDelta::from_std(ahead).unwrap()).naive_local();
            let before = now();
            let told = NaiveDateTime::try_from(local_time_in(ahead).unwrap()).unwrap();
            let after = now();
            // A stamp has whole milliseconds.
            assert!(
                (before - TimeDelta::milliseconds(1)..=after).contains(&told),
                "{before} {told} {after}"
            );
        }
    }

    #[test]
    fn a_time_goes_on_from_where_it_is() {
        let time = parse_time("2026-12-31T23:59:59.990").unwrap();
        let later = time_after(time, std::time::Duration::from_millis(2040));
        assert_eq!(later.to_string(), "2027-01-01T00:00:02.030");
    }

    #[test]
    fn a_time_may_be_written_in_a_few_ways() {
        for (text, meaning) in [
            ("2026-11-22T10:00:00.250", "2026-11-22T10:00:00.250"),
            ("2026-11-22 10:00:00.25", "2026-11-22T10:00:00.250"),
            ("2026-11-22T10:00:00", "2026-11-22T10:00:00.000"),
            ("2026-11-22 10:00", "2026-11-22T10:00:00.000"),
            ("1996-11-22T23:59:59.999", "1996-11-22T23:59:59.999"),
        ] {
            assert_eq!(parse_time(text).map(|time| time.to_string()), Ok(meaning.to_string()));
        }
    }

    #[test]
    fn what_is_wrong_with_a_time_is_said() {
        for (text, complaint) in [
            ("10:00", "not a date and time"),
            ("2026-02-30T10:00:00", "not a date and time"),
            ("2026-11-22T10:00:00Z", "no time zone"),
            ("2026-11-22T10:00:00+01:00", "no time zone"),
            ("2026-11-22T10:00:60", "no second 60"),
            ("2026-11-22T10:00:00.0005", "three decimals"),
            ("2070-01-01T00:00:00", "from 1970 to 2069, not in 2070"),
        ] {
            let error = parse_time(text).unwrap_err();
            assert!(error.contains(complaint), "{text}: {error}");
        }
    }

    #[test]
    fn a_delta_shows_what_is_needed() {
        for (ms, text) in [
            (0, "+0.000 s"),
            (1, "+0.001 s"),
            (-1, "-0.001 s"),
            (59_999, "+59.999 s"),
            (62_003, "+1m02.003 s"),
            (10_862_003, "+3h01m02 s"),
            (-183_662_003, "-2d03h01m"),
        ] {
            assert_eq!(Delta { ms }.to_string(), text);
        }
    }

    #[test]
    fn the_last_moment_of_2069_is_a_millisecond_before_the_first_of_1970() {
        let last = parse_time("2069-12-31T23:59:59.999").unwrap();
        let first = parse_time("1970-01-01T00:00:00.000").unwrap();
        assert_eq!(Delta::between(last, first), Some(Delta { ms: 1 }));
        assert_eq!(Delta::between(first, last), Some(Delta { ms: -1 }));
        assert_eq!(ClockStep::between(last, first), Some(ClockStep::YearsBeganAnew));
        assert_eq!(ClockStep::between(first, last), Some(ClockStep::Back));
        assert_eq!(ClockStep::between(first, first), Some(ClockStep::Forward));
        // A clock that had lost its time and was set again.
        let today = parse_time("2026-11-22T10:00:00").unwrap();
        assert_eq!(ClockStep::between(today, first), Some(ClockStep::Back));
        assert_eq!(ClockStep::between(first, today), Some(ClockStep::Forward));
        // The turn of 1999 to 2000 is nothing special.
        let before = parse_time("1999-12-31T23:59:59.999").unwrap();
        let after = parse_time("2000-01-01T00:00:00.000").unwrap();
        assert_eq!(Delta::between(before, after), Some(Delta { ms: 1 }));
        assert_eq!(ClockStep::between(before, after), Some(ClockStep::Forward));
    }

    #[test]
    fn there_is_no_delta_to_an_impossible_date() {
        let trip = parse_time("2026-11-22T10:00:00.250").unwrap();
        let later = parse_time("2026-11-22T10:00:00.262").unwrap();
        assert_eq!(Delta::between(trip, later), Some(Delta { ms: 12 }));
        assert_eq!(Delta::between(TimeStamp { month: 0, ..trip }, later), None);
    }
}
