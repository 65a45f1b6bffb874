//! Moments as the user gives them.

use ser_evidence::time::{Moment, Utc};

use crate::error::{Failure, Result};

/// A moment of the command line: with an offset it is one, without it depends on the site's zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GivenMoment {
    Absolute(jiff::Timestamp),
    Local(jiff::civil::DateTime),
    /// A time of the day that it is now.
    Today(jiff::civil::Time),
}

/// Understands `2026-11-22T10:00:00.250` (in the zone of the site), also with a blank, without a
/// fraction or seconds, and the same with `Z` or an offset such as `+01:00`. A date alone is its
/// midnight, a time alone is today's.
pub(crate) fn parse_moment(text: &str) -> std::result::Result<GivenMoment, String> {
    let text = text.trim();
    if let Ok(absolute) = text.parse() {
        return Ok(GivenMoment::Absolute(absolute));
    }
    let wrong = "not a date and time like 2026-11-22T10:00:00.250, or with Z or +01:00 at the end; a \
                 date alone is its midnight, a time alone is today's in the zone of the site";
    // What follows a time without a date, such as an offset, would be read and not used.
    let is_plain = |sign: char| sign.is_ascii_digit() || "-:.,T ".contains(sign);
    if !text.chars().all(is_plain) {
        return Err(wrong.to_owned());
    }
    if let Ok(local) = text.parse() {
        return Ok(GivenMoment::Local(local));
    }
    Ok(GivenMoment::Today(text.parse().map_err(|_| wrong)?))
}

impl GivenMoment {
    /// The moment, in the zone of a site.
    pub(crate) fn in_zone(self, zone: &jiff::tz::TimeZone) -> Result<Moment<Utc>> {
        let local = match self {
            GivenMoment::Absolute(timestamp) => {
                return Ok(Moment::from_us(timestamp.as_microsecond()));
            }
            GivenMoment::Local(local) => local,
            GivenMoment::Today(time) => {
                jiff::Timestamp::now().to_zoned_datetime(zone.clone()).date().to_datetime(time)
            }
        };
        let ambiguous = zone.to_ambiguous_timestamp(local);
        let timestamp = ambiguous.unambiguous().map_err(|_| {
            let zone = zone.iana_name().unwrap_or("this zone").to_owned();
            Failure::usage(format!("{local} is twice or never in {zone}"))
                .hint("add the offset from UTC, as in 2026-10-25T02:30:00+01:00")
        })?;
        Ok(Moment::from_us(timestamp.as_microsecond()))
    }
}

/// The zone of this computer.
pub(crate) fn here() -> jiff::tz::TimeZone {
    jiff::tz::TimeZone::try_system().unwrap_or(jiff::tz::TimeZone::UTC)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(text: &str, zone: &str) -> i64 {
        let zone = jiff::tz::TimeZone::get(zone).unwrap();
        parse_moment(text).unwrap().in_zone(&zone).unwrap().us()
    }

    #[test]
    fn a_moment_is_in_the_zone_of_the_site_unless_it_has_an_offset() {
        let expected = us("2026-11-22T10:00:00.250Z", "UTC");
        assert_eq!(us("2026-11-22 11:00:00.250", "Europe/Berlin"), expected);
        assert_eq!(us("2026-11-22T05:00:00.250-05:00", "Europe/Berlin"), expected);
        assert_eq!(us("2026-11-22 11:00", "Europe/Berlin"), expected - 250_000);
        assert_eq!(us("2026-11-22", "UTC"), expected - 36_000_250_000, "midnight");
        for wrong in ["yesterday", "13:45:19+00:00", "13:45:19Z", "2026-11-22+01:00"] {
            assert!(parse_moment(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_time_alone_is_todays() {
        let today =
            || jiff::Timestamp::now().to_zoned_datetime(jiff::tz::TimeZone::UTC).date().to_string();
        let (before, given, after) = (today(), us("12:07", "UTC"), today());
        let of = |date: &str| us(&format!("{date}T12:07:00Z"), "UTC");
        assert!([of(&before), of(&after)].contains(&given));
    }

    #[test]
    fn an_hour_that_comes_twice_needs_an_offset() {
        let zone = jiff::tz::TimeZone::get("Europe/Berlin").unwrap();
        let twice = parse_moment("2026-10-25T02:30:00").unwrap().in_zone(&zone);
        assert!(twice.unwrap_err().is_usage());
    }
}
