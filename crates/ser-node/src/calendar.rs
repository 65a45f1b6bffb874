//! From milliseconds to a date, in the years 1970–2099.
//!
//! Every fourth of these years is a leap year, so the calendar needs only divisions by constants. A
//! library for all years uses look-up tables, and the compiler cannot see that it stays inside
//! them: each look-up has a path to a panic. The interrupts of a recorder must have none.

use chrono::{NaiveDate, NaiveDateTime};

const DAY_MS: i64 = 24 * 60 * 60 * 1000;
const DAY_SECONDS: i64 = 24 * 60 * 60;

/// A day of the years 1970–2099.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Date {
    /// All four digits.
    pub year: u16,
    /// 1–12.
    pub month: u8,
    /// 1–31.
    pub day: u8,
}

impl Date {
    /// Days of these 130 years, 32 of which are leap years.
    const ALL_DAYS: u32 = 130 * 365 + 32;

    /// The date that many days after 1970-01-01; `None` after 2099.
    #[must_use]
    pub fn after_1970(days: u32) -> Option<Date> {
        const YEAR_DAYS: u32 = 365;
        const FOUR_YEARS_DAYS: u32 = 4 * YEAR_DAYS + 1;
        /// Days from 1 March 1968 to 1970. A year that begins in March has its leap day at the very
        /// end.
        const DAYS_TO_1970: u32 = 306 + YEAR_DAYS;

        if days >= Date::ALL_DAYS {
            return None;
        }
        let days = days + DAYS_TO_1970;
        let (fours, day) = (days / FOUR_YEARS_DAYS, days % FOUR_YEARS_DAYS);
        // The 1461st day belongs to the fourth year.
        let year = (day / YEAR_DAYS).min(3);
        let day = day - year * YEAR_DAYS;
        // From March on, five months have 153 days: 31, 30, 31, 30, 31.
        let month = (5 * day + 2) / 153;
        let day = day - (153 * month + 2) / 5 + 1;
        let (month, later) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
        Some(Date {
            year: u16::try_from(1968 + 4 * fours + year + later).ok()?,
            month: u8::try_from(month).ok()?,
            day: u8::try_from(day).ok()?,
        })
    }

    /// The day of a time; `None` outside of 1970–2099.
    #[must_use]
    pub fn of(time: NaiveDateTime) -> Option<Date> {
        let days = time.and_utc().timestamp().div_euclid(DAY_SECONDS);
        Date::after_1970(u32::try_from(days).ok()?)
    }
}

/// The date and time that many milliseconds after the start of 1970; `None` outside of 1970–2099.
#[must_use]
pub fn date_time(calendar_ms: i64) -> Option<NaiveDateTime> {
    let (Date { year, month, day }, ms) = split(calendar_ms)?;
    let date = NaiveDate::from_ymd_opt(year.into(), month.into(), day.into())?;
    date.and_hms_milli_opt(ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
}

/// The day, and the milliseconds of the day.
pub(crate) fn split(calendar_ms: i64) -> Option<(Date, u32)> {
    let date = Date::after_1970(u32::try_from(calendar_ms.div_euclid(DAY_MS)).ok()?)?;
    Some((date, u32::try_from(calendar_ms.rem_euclid(DAY_MS)).ok()?))
}

#[cfg(test)]
mod tests {
    use chrono::{DateTime, Datelike};

    use super::*;

    #[test]
    fn every_day_is_the_one_that_the_library_knows() {
        for days in 0..Date::ALL_DAYS {
            // A different time of day on each date, including the first and the last millisecond.
            for ms in [0, i64::from(days) * 7919 % DAY_MS, DAY_MS - 1] {
                let calendar_ms = i64::from(days) * DAY_MS + ms;
                let known = DateTime::from_timestamp_millis(calendar_ms).unwrap().naive_utc();
                assert_eq!(date_time(calendar_ms), Some(known));
                let Date { year, month, day } = Date::of(known).unwrap();
                assert_eq!(
                    (i32::from(year), u32::from(month), u32::from(day)),
                    (known.year(), known.month(), known.day())
                );
            }
        }
    }

    #[test]
    fn beyond_these_years_there_is_no_date() {
        assert_eq!(date_time(-1), None);
        assert_eq!(date_time(i64::MIN), None);
        assert_eq!(date_time(i64::MAX), None);
        let last = "2099-12-31T23:59:59.999".parse::<NaiveDateTime>().unwrap();
        let last_ms = last.and_utc().timestamp_millis();
        assert_eq!((date_time(last_ms), date_time(last_ms + 1)), (Some(last), None));
        assert_eq!(Date::of("1969-12-31T23:59:59".parse().unwrap()), None);
    }
}
