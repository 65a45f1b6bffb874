//! Times of the day and dates, in the zone of the site.

use jiff::Timestamp;
use jiff::tz::TimeZone;

/// A zone in which times are shown.
#[derive(Clone, Debug)]
pub struct Clock {
    zone: TimeZone,
    /// Whether a time of the day does not say which day, or which offset, is meant.
    needs_date: bool,
    needs_offset: bool,
}

impl Clock {
    /// Shows times in this zone.
    #[must_use]
    pub const fn in_zone(zone: TimeZone) -> Clock {
        Clock { zone, needs_date: false, needs_offset: false }
    }

    /// The same for times from `first_us` to `last_us`: times of the day have a date where these
    /// are of several days, and their offset from UTC where that changes between them.
    #[must_use]
    pub fn over(self, first_us: i64, last_us: i64) -> Clock {
        let differ = |format: &str| self.format(first_us, format) != self.format(last_us, format);
        let (needs_date, needs_offset) = (differ("%Y-%m-%d"), differ("%:z"));
        Clock { needs_date, needs_offset, ..self }
    }

    /// As `2026-11-22 11:00:00.250`, to the nearest millisecond.
    #[must_use]
    pub fn date_and_time(&self, utc_us: i64) -> String {
        self.format(utc_us, "%Y-%m-%d %H:%M:%S%.3f")
    }

    /// As `2026-11-22 11:00:00.250+01:00`, to the nearest millisecond.
    #[must_use]
    pub fn date_and_time_with_offset(&self, utc_us: i64) -> String {
        self.format(utc_us, "%Y-%m-%d %H:%M:%S%.3f%:z")
    }

    /// As `11:00:00.250`, to the nearest millisecond; with date and offset where they are
    /// [needed](Self::over).
    #[must_use]
    pub fn time(&self, utc_us: i64) -> String {
        let (date, offset) = (self.needs_date, self.needs_offset);
        let format = match (date, offset) {
            (false, false) => "%H:%M:%S%.3f",
            (true, false) => "%Y-%m-%d %H:%M:%S%.3f",
            (false, true) => "%H:%M:%S%.3f%:z",
            (true, true) => "%Y-%m-%d %H:%M:%S%.3f%:z",
        };
        self.format(utc_us, format)
    }

    /// As `2026-11-22`.
    #[must_use]
    pub fn date(&self, utc_us: i64) -> String {
        self.format(utc_us, "%Y-%m-%d")
    }

    /// The zone as `Europe/Berlin, UTC+01:00`.
    #[must_use]
    pub fn zone(&self, utc_us: i64) -> String {
        let offset = self.format(utc_us, "UTC%:z");
        match self.zone.iana_name() {
            Some("UTC" | "Etc/UTC") | None => offset.trim_end_matches("+00:00").to_owned(),
            Some(name) => format!("{name}, {offset}"),
        }
    }

    fn format(&self, utc_us: i64, format: &str) -> String {
        // To the nearest millisecond, as the fraction is cut off.
        let nearest = utc_us.saturating_add(500).div_euclid(1000).saturating_mul(1000);
        let time =
            Timestamp::from_microsecond(nearest).map(|at| at.to_zoned_datetime(self.zone.clone()));
        time.map_or_else(|_| "-".to_owned(), |time| time.strftime(format).to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_site() {
        let us = "2026-11-22T10:00:00.2496Z".parse::<Timestamp>().unwrap().as_microsecond();
        let clock = Clock::in_zone(TimeZone::get("Europe/Berlin").unwrap());
        assert_eq!(clock.date_and_time(us), "2026-11-22 11:00:00.250");
        assert_eq!(clock.zone(us), "Europe/Berlin, UTC+01:00");
        assert_eq!(Clock::in_zone(TimeZone::UTC).zone(us), "UTC");
        assert_eq!(clock.time(i64::MAX), "-");
        let berlin = || Clock::in_zone(TimeZone::get("Europe/Berlin").unwrap());
        assert_eq!(berlin().over(us, us + 1_000_000).time(us), "11:00:00.250");
        assert_eq!(berlin().over(us, us + 86_400_000_000).time(us), "2026-11-22 11:00:00.250");
        let summer = us - 29 * 86_400_000_000;
        assert_eq!(berlin().over(summer, us).time(summer), "2026-10-24 12:00:00.250+02:00");
    }
}
