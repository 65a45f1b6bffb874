//! From the fields of a stamp to a moment on the recorder's own scale.

use ser_proto::TimeStamp;

use super::moment::{Moment, Shown};

/// Microseconds of the hundred years that two digits can express, 1970–2069.
pub const CENTURY_US: i64 = 36_525 * DAY_US;

/// The most that two stamps differ on either side of the end of 2069, where the two digits of the
/// year begin again: ten years. With a larger difference, a clock was set.
pub const AROUND_2069_US: i64 = 10 * 366 * DAY_US;

const DAY_US: i64 = 86_400_000_000;

/// What the clock showed; `None` if the stamp holds an impossible date.
#[must_use]
pub fn shown(stamp: &TimeStamp) -> Option<Moment<Shown>> {
    stamp.check().ok()?;
    let days = days_since_1970(stamp.full_year(), stamp.month, stamp.day);
    let seconds =
        (i64::from(stamp.hour) * 60 + i64::from(stamp.minute)) * 60 + i64::from(stamp.second);
    let us = seconds * 1_000_000 + i64::from(stamp.millisecond) * 1000;
    Some(Moment::from_us(days * DAY_US + us))
}

/// The stamp of a moment; `None` outside 1970–2069, or between two milliseconds.
#[must_use]
pub fn stamp(moment: Moment<Shown>) -> Option<TimeStamp> {
    let us = Some(moment.us()).filter(|us| (0..CENTURY_US).contains(us) && us % 1000 == 0)?;
    let days = us / DAY_US;
    let begins_by = |year, month| days_since_1970(year, month, 1) <= days;
    let year = (1970..=2069).rev().find(|&year| begins_by(year, 1))?;
    let month = (1..=12).rev().find(|&month| begins_by(year, month))?;
    let day = days - days_since_1970(year, month, 1) + 1;
    let byte = |value: i64| u8::try_from(value).ok();
    let second = us / 1_000_000;
    Some(TimeStamp {
        year: u8::try_from(year % 100).ok()?,
        month,
        day: byte(day)?,
        hour: byte(second / 3600 % 24)?,
        minute: byte(second / 60 % 60)?,
        second: byte(second % 60)?,
        millisecond: u16::try_from(us / 1000 % 1000).ok()?,
    })
}

/// Days from the beginning of 1970 to a date of 1970–2069, where every fourth year is a leap year.
fn days_since_1970(year: u16, month: u8, day: u8) -> i64 {
    const BEFORE_MONTH: [i64; 12] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334];
    let years = i64::from(year) - 1970;
    // 1972 is the first leap year.
    let leap_days = (years + 1) / 4 + i64::from(year.is_multiple_of(4) && month > 2);
    let before_month =
        BEFORE_MONTH.get(usize::from(month).wrapping_sub(1)).copied().unwrap_or_default();
    years * 365 + leap_days + before_month + i64::from(day) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> TimeStamp {
        let number = |range: std::ops::Range<usize>| text[range].parse::<u16>().unwrap();
        let byte = |range| u8::try_from(number(range)).unwrap();
        TimeStamp {
            year: u8::try_from(number(0..4) % 100).unwrap(),
            month: byte(5..7),
            day: byte(8..10),
            hour: byte(11..13),
            minute: byte(14..16),
            second: byte(17..19),
            millisecond: number(20..23),
        }
    }

    /// Another program's calendar decides.
    #[test]
    fn every_day_of_the_century_is_where_jiff_has_it() {
        let first = jiff::civil::date(1970, 1, 1);
        for days in 0..36_525_i64 {
            let date = first.checked_add(jiff::Span::new().days(days)).unwrap();
            let text = format!("{date}T00:00:00.000");
            let moment = Moment::from_us(days * DAY_US);
            assert_eq!(shown(&parsed(&text)), Some(moment), "{text}");
            assert_eq!(
                stamp(moment.after(86_399_999_000)).unwrap().to_string(),
                format!("{date}T23:59:59.999")
            );
        }
    }

    #[test]
    fn the_time_of_day_counts_to_the_millisecond() {
        let at = |text| shown(&parsed(text)).unwrap();
        assert_eq!(at("2026-11-22T10:00:00.250").since(at("2026-11-22T09:59:59.999")), 251_000);
        assert_eq!(at("2000-01-01T00:00:00.000").since(at("1999-12-31T23:59:59.999")), 1000);
    }

    #[test]
    fn an_impossible_date_is_no_moment() {
        let stamp = parsed("2026-02-29T10:00:00.000");
        assert_eq!(shown(&stamp), None);
    }

    #[test]
    fn a_moment_that_no_clock_shows_has_no_stamp() {
        for us in [-1000, 1, CENTURY_US, i64::MAX, i64::MIN] {
            assert_eq!(stamp(Moment::from_us(us)), None, "{us}");
        }
    }
}
