//! Moments as the user gives them.

use ser_evidence::time::{Moment, Utc};

use crate::error::{Failure, Result};

/// A moment of the command line, given to the second, to the minute, or as a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GivenMoment {
    given: Given,
    /// How long that lasts: nothing, a second, a minute, an hour or a day.
    lasts: jiff::SignedDuration,
}

/// With an offset it is one moment, without it depends on the site's zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Given {
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
    Ok(GivenMoment { given: parse(text)?, lasts: lasts(text) })
}

fn parse(text: &str) -> std::result::Result<Given, String> {
    if let Ok(absolute) = text.parse() {
        return Ok(Given::Absolute(absolute));
    }
    let wrong = "not a date and time like 2026-11-22T10:00:00.250, or with Z or +01:00 at the end; a \
                 date alone is its midnight, a time alone is today's in the zone of the site";
    // What follows a time without a date, such as an offset, would be read and not used.
    let is_plain = |sign: char| sign.is_ascii_digit() || "-:.,T ".contains(sign);
    if !text.chars().all(is_plain) {
        return Err(wrong.to_owned());
    }
    if let Ok(local) = text.parse() {
        return Ok(Given::Local(local));
    }
    Ok(Given::Today(text.parse().map_err(|_| wrong)?))
}

/// How long a moment lasts that is written like this.
fn lasts(text: &str) -> jiff::SignedDuration {
    let time = match text.split_once(['T', 't', ' ']) {
        Some((_, time)) => time,
        None if text.contains(':') => text,
        None => return jiff::SignedDuration::from_hours(24),
    };
    let time = time.split(['Z', 'z', '+', '-']).next().unwrap_or_default();
    match time.chars().filter(char::is_ascii_digit).count() {
        _ if time.contains(['.', ',']) => jiff::SignedDuration::ZERO,
        0..=2 => jiff::SignedDuration::from_hours(1),
        3..=4 => jiff::SignedDuration::from_mins(1),
        _ => jiff::SignedDuration::from_secs(1),
    }
}

impl GivenMoment {
    /// Its first and its last microsecond, in the zone of a site.
    pub(crate) fn span_in_zone(
        self,
        zone: &jiff::tz::TimeZone,
    ) -> Result<(Moment<Utc>, Moment<Utc>)> {
        let first = self.in_zone(zone)?;
        let lasts_us = i64::try_from(self.lasts.as_micros()).unwrap_or_default();
        Ok((first, first.after((lasts_us - 1).max(0))))
    }

    /// The moment, in the zone of a site; of a longer one its beginning.
    pub(crate) fn in_zone(self, zone: &jiff::tz::TimeZone) -> Result<Moment<Utc>> {
        let local = match self.given {
            Given::Absolute(timestamp) => {
                return Ok(Moment::from_us(timestamp.as_microsecond()));
            }
            Given::Local(local) => local,
            Given::Today(time) => {
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
    fn a_moment_lasts_as_long_as_it_is_coarse() {
        let lasts_us = |text: &str| {
            let span = parse_moment(text).unwrap().span_in_zone(&jiff::tz::TimeZone::UTC).unwrap();
            span.1.since(span.0) + 1
        };
        for (text, us) in [
            ("2026-11-22", 86_400_000_000),
            ("07:45", 60_000_000),
            ("2026-11-22T07:45Z", 60_000_000),
            ("2026-11-22T07:45+01:00", 60_000_000),
            ("2026-11-22 07:45:12", 1_000_000),
            ("2026-11-22 07:45:12-05:00", 1_000_000),
            ("2026-11-22 07:45:12.000", 1),
        ] {
            assert_eq!(lasts_us(text), us, "{text}");
        }
    }

    #[test]
    fn an_hour_that_comes_twice_needs_an_offset() {
        let zone = jiff::tz::TimeZone::get("Europe/Berlin").unwrap();
        let twice = parse_moment("2026-10-25T02:30:00").unwrap().in_zone(&zone);
        assert!(twice.unwrap_err().is_usage());
    }
}
