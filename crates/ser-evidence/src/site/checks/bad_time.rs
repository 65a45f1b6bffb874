//! A time that is none, or of the wrong kind: `host_time`, `from` and `to` need `Z` or an offset
//! from UTC; `unit_time` has none, because a recorder's clock has no zone.
//!
//! Why: a time without its offset is another time in summer than in winter.
//!
//! Bad:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[observation]]
//! recorder = "U1-SER1"
//! host_time = "2026-11-22T09:00:00"
//! unit_time = "2026-11-22T09:00:00.120"
//! doubt_ms = 100
//! ```
//! Good:
//! ```toml
//! [[recorder]]
//! name = "U1-SER1"
//! [[observation]]
//! recorder = "U1-SER1"
//! host_time = "2026-11-22T09:00:00Z"
//! unit_time = "2026-11-22T09:00:00.120"
//! doubt_ms = 100
//! ```

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::TimeZone;

use crate::site::diagnostic::{Diagnostic, Findings, Span};
use crate::time::{Moment, Shown, Utc};

/// The name of this check.
pub(in crate::site) const NAME: &str = "bad-time";

/// A moment in UTC.
pub(in crate::site) fn utc(
    findings: &mut Findings,
    (span, text): (&Span, &str),
    key: &str,
) -> Option<Moment<Utc>> {
    let wrong = match text.parse::<Timestamp>() {
        Ok(time) if time.subsec_nanosecond() % 1000 != 0 => "at most six decimals are kept",
        Ok(time) if time.as_second() < 0 => "must be 1970 or later",
        Ok(time) => return Some(Moment::from_us(time.as_microsecond())),
        Err(_) if text.parse::<DateTime>().is_ok() => "`Z` or the offset from UTC is missing",
        Err(_) => "not a date and time",
    };
    let example = "2026-11-22T09:00:00Z` or `2026-11-22T10:00:00+01:00";
    findings.add(diagnostic(span, key, wrong, example));
    None
}

/// What a recorder's clock showed.
pub(in crate::site) fn shown(
    findings: &mut Findings,
    (span, text): (&Span, &str),
    key: &str,
) -> Option<Moment<Shown>> {
    let wrong = match text.parse::<DateTime>() {
        // jiff takes a date for its midnight.
        Ok(_) if !text.contains(':') => "the time of day is missing",
        // jiff ignores an offset here, and this must not be.
        Ok(_) if has_offset(text) => "a recorder's clock has no zone",
        Ok(time) if time.subsec_nanosecond() % 1_000_000 != 0 => {
            "a recorder's clock has milliseconds"
        }
        Ok(time) if !(1970..=2069).contains(&time.year()) => "a clock runs from 1970 to 2069",
        Ok(time) => return Some(Moment::from_us(microseconds(time)?)),
        Err(_) if text.parse::<Timestamp>().is_ok() => "a recorder's clock has no zone",
        Err(_) => "not a date and time",
    };
    findings.add(diagnostic(span, key, wrong, "2026-11-22T09:00:00.120"));
    None
}

fn microseconds(time: DateTime) -> Option<i64> {
    Some(TimeZone::UTC.to_timestamp(time).ok()?.as_microsecond())
}

fn has_offset(text: &str) -> bool {
    let after_date = text.get(10..).unwrap_or_default();
    after_date.contains(['Z', 'z', '+', '-', '['])
}

fn diagnostic(span: &Span, key: &str, wrong: &str, example: &str) -> Diagnostic {
    Diagnostic::error(NAME, span.clone(), format!("`{key}` is not a time that can be used"))
        .label(wrong)
        .help(format!("write it as in `{example}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_in_utc_has_its_offset() {
        let of = |text| utc(&mut Findings::default(), (&(0..0), text), "to").map(Moment::us);
        assert_eq!(of("1970-01-01T00:00:01Z"), Some(1_000_000));
        assert_eq!(of("1970-01-01T01:00:00.000001+01:00"), Some(1));
        for text in [
            "1970-01-01T00:00:01",
            "1969-12-31T23:59:59Z",
            "1970-01-01T00:00:00.0000001Z",
            "1970-01-01",
            "10:00",
            "",
        ] {
            assert_eq!(of(text), None, "{text}");
        }
    }

    #[test]
    fn what_a_clock_showed_has_none() {
        let of = |text| shown(&mut Findings::default(), (&(0..0), text), "t").map(Moment::us);
        assert_eq!(of("1970-01-01T00:00:01.002"), Some(1_002_000));
        assert_eq!(of("1970-01-01 00:00:01"), Some(1_000_000));
        for text in [
            "1970-01-01T00:00:01Z",
            "1970-01-01T00:00:01+01:00",
            "1970-01-01T00:00:01[UTC]",
            "2070-01-01T00:00:00",
            "1970-01-01T00:00:00.0001",
            "2026-02-29T00:00:00",
            "2026-02-28",
        ] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
