//! The eight bytes of date and time in entries and in the set-clock command.
//!
//! ```text
//! | year | month | day | hour | minute | second | millisecond (2) |
//! ```
//!
//! A stamp from the wire may hold an impossible date, for example from a recorder whose clock was
//! never set. It is kept as it is because no entry may be lost over it; [`TimeStamp::check`] finds
//! it.

use core::fmt;

use nom::Parser;
use nom::number::complete::{be_u8, be_u16};

use crate::Body;
use crate::fields::{Bytes, Fault};

/// A date and time of day with a resolution of one millisecond, in the time zone to which the
/// recorder was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TimeStamp {
    /// Year of the century, 0–99: 0–69 are 2000–2069, 70–99 are 1970–1999.
    pub year: u8,
    /// Month, 1–12.
    pub month: u8,
    /// Day of the month, 1–31.
    pub day: u8,
    /// Hour, 0–23.
    pub hour: u8,
    /// Minute, 0–59.
    pub minute: u8,
    /// Second, 0–59.
    pub second: u8,
    /// Millisecond, 0–999.
    pub millisecond: u16,
}

/// The first field of a [`TimeStamp`] that holds an impossible value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InvalidTime {
    /// Where the field starts among the eight bytes.
    pub offset: usize,
    /// What it holds.
    pub value: u16,
}

impl TimeStamp {
    /// Bytes on the wire.
    pub const LEN: usize = 8;

    /// The year in full: 1970–2069 for every valid stamp.
    #[must_use]
    pub const fn full_year(&self) -> u16 {
        match self.year {
            0..=69 => 2000 + self.year as u16,
            _ => 1900 + self.year as u16,
        }
    }

    /// Whether this date and time exist.
    ///
    /// # Errors
    /// The first field, in wire order, that is out of range. A day is also out of range when the
    /// month is too short for it.
    pub fn check(&self) -> Result<(), InvalidTime> {
        let fields = [
            (self.year, 0, 99),
            (self.month, 1, 12),
            (self.day, 1, self.days_in_month()),
            (self.hour, 0, 23),
            (self.minute, 0, 59),
            (self.second, 0, 59),
        ];
        for (offset, (value, first, last)) in fields.into_iter().enumerate() {
            if value < first || value > last {
                return Err(InvalidTime { offset, value: value.into() });
            }
        }
        if self.millisecond > 999 {
            return Err(InvalidTime { offset: 6, value: self.millisecond });
        }
        Ok(())
    }

    fn days_in_month(&self) -> u8 {
        match self.month {
            // Every fourth year of 1970–2069 is a leap year; 2000 is one too.
            2 if self.year.is_multiple_of(4) => 29,
            2 => 28,
            4 | 6 | 9 | 11 => 30,
            _ => 31,
        }
    }

    pub(crate) fn parser<'a>() -> impl Parser<Bytes<'a>, Output = TimeStamp, Error = Fault> {
        (be_u8, be_u8, be_u8, be_u8, be_u8, be_u8, be_u16).map(
            |(year, month, day, hour, minute, second, millisecond)| TimeStamp {
                year,
                month,
                day,
                hour,
                minute,
                second,
                millisecond,
            },
        )
    }

    pub(crate) fn put_on(&self, body: &mut Body) {
        body.put(&[self.year, self.month, self.day, self.hour, self.minute, self.second]);
        body.put_u16(self.millisecond);
    }
}

/// As `2026-11-22T10:00:00.250`, even for an impossible date.
impl fmt::Display for TimeStamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}",
            self.full_year(),
            self.month,
            self.day,
            self.hour,
            self.minute,
            self.second,
            self.millisecond
        )
    }
}

impl InvalidTime {
    /// The name of the field: `year` … `millisecond`.
    #[must_use]
    pub fn field(&self) -> &'static str {
        const FIELDS: [&str; 7] =
            ["year", "month", "day", "hour", "minute", "second", "millisecond"];
        FIELDS.get(self.offset).copied().unwrap_or("field")
    }
}

impl fmt::Display for InvalidTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no {} {} in such a date", self.field(), self.value)
    }
}

impl core::error::Error for InvalidTime {}

#[cfg(feature = "chrono")]
mod chrono_conversions {
    use chrono::{Datelike, NaiveDate, NaiveDateTime, Timelike};

    use super::{InvalidTime, TimeStamp};

    /// Fails when the date or time does not exist.
    impl TryFrom<TimeStamp> for NaiveDateTime {
        type Error = InvalidTime;

        fn try_from(stamp: TimeStamp) -> Result<NaiveDateTime, InvalidTime> {
            stamp.check()?;
            NaiveDate::from_ymd_opt(stamp.full_year().into(), stamp.month.into(), stamp.day.into())
                .and_then(|date| {
                    date.and_hms_milli_opt(
                        stamp.hour.into(),
                        stamp.minute.into(),
                        stamp.second.into(),
                        stamp.millisecond.into(),
                    )
                })
                .ok_or(InvalidTime { offset: 2, value: stamp.day.into() })
        }
    }

    /// Truncates to the millisecond; fails outside 1970–2069, which a two-digit year cannot
    /// express.
    impl TryFrom<NaiveDateTime> for TimeStamp {
        type Error = InvalidTime;

        fn try_from(time: NaiveDateTime) -> Result<TimeStamp, InvalidTime> {
            let year = match time.year() {
                1970..=1999 => time.year() - 1900,
                2000..=2069 => time.year() - 2000,
                other => {
                    return Err(InvalidTime {
                        offset: 0,
                        value: u16::try_from(other).unwrap_or(u16::MAX),
                    });
                }
            };
            // chrono represents a leap second as 1000 ms or more.
            let millisecond = (time.nanosecond() / 1_000_000).min(999);
            let narrow = |value: u32| u8::try_from(value).unwrap_or(u8::MAX);
            Ok(TimeStamp {
                year: u8::try_from(year).unwrap_or(u8::MAX),
                month: narrow(time.month()),
                day: narrow(time.day()),
                hour: narrow(time.hour()),
                minute: narrow(time.minute()),
                second: narrow(time.second()),
                millisecond: u16::try_from(millisecond).unwrap_or(999),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIP: TimeStamp = TimeStamp {
        year: 26,
        month: 11,
        day: 22,
        hour: 10,
        minute: 0,
        second: 0,
        millisecond: 250,
    };

    #[test]
    fn two_digit_years_turn_at_seventy() {
        for (year, full) in [(0, 2000), (69, 2069), (70, 1970), (96, 1996), (99, 1999)] {
            assert_eq!(TimeStamp { year, ..TRIP }.full_year(), full);
        }
    }

    #[test]
    fn each_field_is_checked_where_it_stands() {
        assert_eq!(TRIP.check(), Ok(()));
        let bad = [
            (TimeStamp { year: 100, ..TRIP }, 0, 100),
            (TimeStamp { month: 0, ..TRIP }, 1, 0),
            (TimeStamp { month: 13, ..TRIP }, 1, 13),
            (TimeStamp { day: 0, ..TRIP }, 2, 0),
            (TimeStamp { day: 31, ..TRIP }, 2, 31),
            (TimeStamp { month: 2, day: 29, ..TRIP }, 2, 29),
            (TimeStamp { hour: 24, ..TRIP }, 3, 24),
            (TimeStamp { minute: 60, ..TRIP }, 4, 60),
            (TimeStamp { second: 60, ..TRIP }, 5, 60),
            (TimeStamp { millisecond: 1000, ..TRIP }, 6, 1000),
        ];
        for (stamp, offset, value) in bad {
            assert_eq!(stamp.check(), Err(InvalidTime { offset, value }), "{stamp}");
        }
        assert_eq!(TimeStamp { year: 24, month: 2, day: 29, ..TRIP }.check(), Ok(()));
        assert_eq!(TimeStamp { year: 0, month: 2, day: 29, ..TRIP }.check(), Ok(()));
    }

    #[test]
    fn a_stamp_reads_like_a_date() {
        assert_eq!(TRIP.to_string(), "2026-11-22T10:00:00.250");
    }

    #[cfg(feature = "chrono")]
    #[test]
    fn every_day_of_the_century_converts_to_chrono_and_back() {
        use chrono::{Days, NaiveDate, NaiveDateTime};

        let mut time =
            NaiveDate::from_ymd_opt(1970, 1, 1).unwrap().and_hms_milli_opt(23, 59, 58, 7).unwrap();
        for _ in 0..36_525 {
            let stamp = TimeStamp::try_from(time).unwrap();
            assert_eq!(NaiveDateTime::try_from(stamp), Ok(time));
            time = time.checked_add_days(Days::new(1)).unwrap();
        }
        assert_eq!(TimeStamp::try_from(time), Err(InvalidTime { offset: 0, value: 2070 }));
    }
}
