//! What a recorder's clock is set to, by the site file.

use std::fmt;
use std::time::Duration;

use jiff::tz::{Offset, TimeZone};
use jiff::{SignedDuration, Timestamp};
use ser_evidence::site::{ClockRule, Site};
use ser_proto::TimeStamp;

/// A time zone for a clock that has none.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockSetting {
    zone: TimeZone,
}

impl ClockSetting {
    /// What the rule means at this site.
    pub fn of(rule: ClockRule, site: &Site) -> ClockSetting {
        let zone = match rule {
            ClockRule::Utc => TimeZone::UTC,
            ClockRule::Local => site.time_zone.clone(),
            // The file has offsets of up to 14 hours.
            ClockRule::Offset(seconds) => {
                Offset::from_seconds(seconds).map_or(TimeZone::UTC, TimeZone::fixed)
            }
        };
        ClockSetting { zone }
    }

    /// The local time of this computer.
    pub fn of_this_computer() -> ClockSetting {
        ClockSetting { zone: TimeZone::system() }
    }

    /// What the clock should show at a time in UTC, both in microseconds since 1970; `None` beyond
    /// the years that there are.
    pub fn shown_us(&self, utc_us: i64) -> Option<i64> {
        let time = Timestamp::from_microsecond(utc_us).ok()?;
        let offset_s = self.zone.to_offset(time).seconds();
        utc_us.checked_add(i64::from(offset_s) * 1_000_000)
    }

    /// The time `ahead` from now, as the clock should show it. An error with its year if the two
    /// digits of a stamp cannot express it.
    pub fn time_in(&self, ahead: Duration) -> Result<TimeStamp, i32> {
        self.time_at(Timestamp::now(), ahead)
    }

    fn time_at(&self, now: Timestamp, ahead: Duration) -> Result<TimeStamp, i32> {
        let ahead = SignedDuration::try_from(ahead).unwrap_or_default();
        let time = self.zone.to_datetime(now.saturating_add(ahead).unwrap_or(now));
        let year = i32::from(time.year());
        let field = |value: i8| u8::try_from(value).map_err(|_| year);
        let stamp = TimeStamp {
            year: u8::try_from(year.rem_euclid(100)).map_err(|_| year)?,
            month: field(time.month())?,
            day: field(time.day())?,
            hour: field(time.hour())?,
            minute: field(time.minute())?,
            second: field(time.second())?,
            millisecond: u16::try_from(time.millisecond()).map_err(|_| year)?,
        };
        if i32::from(stamp.full_year()) == year { Ok(stamp) } else { Err(year) }
    }
}

/// As `UTC`, `Europe/Berlin` or `+05:30`.
impl fmt::Display for ClockSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.zone.iana_name() {
            Some(name) => f.write_str(name),
            None => match self.zone.to_fixed_offset() {
                Ok(offset) => write!(f, "{offset}"),
                Err(_) => f.write_str("local time"),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(rule: ClockRule, now: &str, ahead_ms: u64) -> Result<String, i32> {
        let site = Site { time_zone: TimeZone::get("Europe/Berlin").unwrap(), ..Site::unknown() };
        let setting = ClockSetting::of(rule, &site);
        let stamp = setting.time_at(now.parse().unwrap(), Duration::from_millis(ahead_ms));
        stamp.map(|stamp| stamp.to_string())
    }

    #[test]
    fn a_clock_shows_what_the_site_file_says() {
        let summer = "2026-07-01T22:30:00.250Z";
        for (rule, shown) in [
            (ClockRule::Utc, "2026-07-01T22:30:00.250"),
            (ClockRule::Local, "2026-07-02T00:30:00.250"),
            (ClockRule::Offset(19_800), "2026-07-02T04:00:00.250"),
            (ClockRule::Offset(-10_800), "2026-07-01T19:30:00.250"),
        ] {
            assert_eq!(at(rule, summer, 0).as_deref(), Ok(shown));
        }
        assert_eq!(
            at(ClockRule::Local, "2026-12-01T00:00:00Z", 0).unwrap(),
            "2026-12-01T01:00:00.000"
        );
    }

    #[test]
    fn the_time_ahead_is_that_of_then() {
        // The clocks go forward in between.
        let shown = at(ClockRule::Local, "2026-03-29T00:59:59.900Z", 200).unwrap();
        assert_eq!(shown, "2026-03-29T03:00:00.100");
    }

    #[test]
    fn the_zone_is_that_of_the_time_in_question() {
        let site = Site { time_zone: TimeZone::get("Europe/Berlin").unwrap(), ..Site::unknown() };
        let local = ClockSetting::of(ClockRule::Local, &site);
        let us = |text: &str| text.parse::<Timestamp>().unwrap().as_microsecond();
        for (utc, ahead_h) in [("2026-03-29T00:59:59.9Z", 1), ("2026-03-29T01:00:00Z", 2)] {
            assert_eq!(local.shown_us(us(utc)), Some(us(utc) + ahead_h * 3_600_000_000));
        }
        assert_eq!(local.shown_us(i64::MAX), None);
    }

    #[test]
    fn a_year_that_no_clock_shows_is_told() {
        assert_eq!(
            at(ClockRule::Utc, "2069-12-31T23:59:59.999Z", 0).unwrap(),
            "2069-12-31T23:59:59.999"
        );
        assert_eq!(at(ClockRule::Utc, "2069-12-31T23:59:59.999Z", 1), Err(2070));
        assert_eq!(at(ClockRule::Utc, "1969-12-31T23:59:59Z", 0), Err(1969));
    }

    #[test]
    fn what_it_should_show_is_reckoned_to_the_microsecond() {
        let site = Site { time_zone: TimeZone::get("Europe/Berlin").unwrap(), ..Site::unknown() };
        let shown = |rule, utc_us| ClockSetting::of(rule, &site).shown_us(utc_us);
        assert_eq!(shown(ClockRule::Utc, 7), Some(7));
        assert_eq!(shown(ClockRule::Offset(-60), 60_000_007), Some(7));
        assert_eq!(shown(ClockRule::Local, 7), Some(3_600_000_007), "in January 1970");
        assert_eq!(shown(ClockRule::Local, i64::MAX), None);
    }

    #[test]
    fn its_name_is_told() {
        let berlin = Site { time_zone: TimeZone::get("Europe/Berlin").unwrap(), ..Site::unknown() };
        let name = |rule| ClockSetting::of(rule, &berlin).to_string();
        assert_eq!(name(ClockRule::Utc), "UTC");
        assert_eq!(name(ClockRule::Local), "Europe/Berlin");
        assert_eq!(name(ClockRule::Offset(19_800)), "+05:30");
    }
}
