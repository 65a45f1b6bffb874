//! Times of clocks that nobody observed: by what the site says they are set to.

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::{AmbiguousOffset, TimeZone};

use crate::site::ClockRule;
use crate::time::{Moment, Shown, Utc};

/// The beginning of 1990. A clock that shows an earlier time was never set: recorders of this kind are
/// younger, and begin to count at 1970.
const FIRST_US: i64 = 7305 * 86_400_000_000;

/// What a clock's time is in UTC if it shows what it is said to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nominal {
    /// This.
    Time(Moment<Utc>),
    /// The hour came twice, and nothing tells which it is: the earlier and the later one.
    Ambiguous(Moment<Utc>, Moment<Utc>),
    /// The hour was left out. This is what it would have been had the zone not changed.
    Missing(Moment<Utc>),
    /// The clock was never set, or shows an impossible date.
    NotKnown,
}

impl Nominal {
    /// By what the site says about a clock.
    pub(crate) fn of(shown: Moment<Shown>, rule: ClockRule, zone: &TimeZone) -> Nominal {
        if is_unset(shown) {
            return Nominal::NotKnown;
        }
        let at = |seconds: i64| Moment::from_us(shown.us() - seconds * 1_000_000);
        match rule {
            ClockRule::Utc => Nominal::Time(at(0)),
            ClockRule::Offset(seconds) => Nominal::Time(at(seconds.into())),
            ClockRule::Local => {
                let Some(civil) = civil(shown) else { return Nominal::NotKnown };
                match zone.to_ambiguous_timestamp(civil).offset() {
                    AmbiguousOffset::Unambiguous { offset } => {
                        Nominal::Time(at(offset.seconds().into()))
                    }
                    AmbiguousOffset::Fold { before, after } => {
                        Nominal::Ambiguous(at(before.seconds().into()), at(after.seconds().into()))
                    }
                    AmbiguousOffset::Gap { before, .. } => {
                        Nominal::Missing(at(before.seconds().into()))
                    }
                }
            }
        }
    }

    /// The same, where the neighbours in the sequence tell which of two hours it is.
    pub(crate) fn between(
        self,
        previous: Option<Moment<Utc>>,
        next: Option<Moment<Utc>>,
    ) -> Nominal {
        match self {
            Nominal::Ambiguous(earlier, _)
                if next.is_some_and(|next| next < self.latest(earlier)) =>
            {
                Nominal::Time(earlier)
            }
            Nominal::Ambiguous(earlier, later)
                if previous.is_some_and(|before| before > earlier) =>
            {
                Nominal::Time(later)
            }
            other => other,
        }
    }

    fn latest(self, otherwise: Moment<Utc>) -> Moment<Utc> {
        match self {
            Nominal::Ambiguous(_, later) => later,
            _ => otherwise,
        }
    }

    /// One moment for sorting: the earlier one if there are two.
    pub(crate) fn earliest(self) -> Option<Moment<Utc>> {
        match self {
            Nominal::Time(time) | Nominal::Ambiguous(time, _) | Nominal::Missing(time) => {
                Some(time)
            }
            Nominal::NotKnown => None,
        }
    }
}

/// Whether a clock that shows this was never set.
pub(crate) fn is_unset(shown: Moment<Shown>) -> bool {
    shown.us() < FIRST_US
}

/// What the clock showed as a civil date and time.
pub(crate) fn civil(shown: Moment<Shown>) -> Option<DateTime> {
    let timestamp = Timestamp::from_microsecond(shown.us()).ok()?;
    Some(TimeZone::UTC.to_datetime(timestamp))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> Moment<Shown> {
        let civil: DateTime = text.parse().unwrap();
        Moment::from_us(TimeZone::UTC.to_timestamp(civil).unwrap().as_microsecond())
    }

    fn utc(text: &str) -> Moment<Utc> {
        Moment::from_us(text.parse::<Timestamp>().unwrap().as_microsecond())
    }

    fn in_zone(zone: &str, shown: &str) -> Nominal {
        Nominal::of(at(shown), ClockRule::Local, &TimeZone::get(zone).unwrap())
    }

    #[test]
    fn berlin_and_new_york_over_both_changes_of_the_year() {
        for (zone, shown, expected) in [
            ("Europe/Berlin", "2026-03-29T01:59:59.999", "2026-03-29T00:59:59.999Z"),
            ("Europe/Berlin", "2026-03-29T03:00:00", "2026-03-29T01:00:00Z"),
            ("Europe/Berlin", "2026-10-25T01:59:59.999", "2026-10-24T23:59:59.999Z"),
            ("Europe/Berlin", "2026-10-25T03:00:00", "2026-10-25T02:00:00Z"),
            ("America/New_York", "2026-03-08T01:59:59", "2026-03-08T06:59:59Z"),
            ("America/New_York", "2026-03-08T03:00:00", "2026-03-08T07:00:00Z"),
            ("America/New_York", "2026-11-01T00:59:59", "2026-11-01T04:59:59Z"),
            ("America/New_York", "2026-11-01T02:00:00", "2026-11-01T07:00:00Z"),
        ] {
            assert_eq!(in_zone(zone, shown), Nominal::Time(utc(expected)), "{zone} {shown}");
        }
    }

    #[test]
    fn a_lone_half_past_two_in_autumn_may_be_either() {
        let (earlier, later) = (utc("2026-10-25T00:30:00Z"), utc("2026-10-25T01:30:00Z"));
        let lone = in_zone("Europe/Berlin", "2026-10-25T02:30:00");
        assert_eq!(lone, Nominal::Ambiguous(earlier, later));
        assert_eq!(lone.between(None, None), lone);
        // A neighbour between the two decides.
        let between = utc("2026-10-25T01:00:00Z");
        assert_eq!(lone.between(Some(between), None), Nominal::Time(later));
        assert_eq!(lone.between(None, Some(between)), Nominal::Time(earlier));
        // One far away does not.
        let (before, after) = (utc("2026-10-24T00:00:00Z"), utc("2026-10-26T00:00:00Z"));
        assert_eq!(lone.between(Some(before), Some(after)), lone);
    }

    #[test]
    fn a_half_past_two_that_was_left_out_in_spring_is_kept_and_marked() {
        let missing = in_zone("Europe/Berlin", "2026-03-29T02:30:00");
        assert_eq!(missing, Nominal::Missing(utc("2026-03-29T01:30:00Z")));
    }

    #[test]
    fn a_clock_that_was_never_set_has_no_time() {
        assert_eq!(in_zone("Europe/Berlin", "1970-01-02T10:00:00"), Nominal::NotKnown);
        let utc_rule = Nominal::of(at("1989-12-31T23:59:59"), ClockRule::Utc, &TimeZone::UTC);
        assert_eq!(utc_rule, Nominal::NotKnown);
        let first = Nominal::of(at("1999-12-31T23:59:59.999"), ClockRule::Utc, &TimeZone::UTC);
        assert_eq!(first, Nominal::Time(utc("1999-12-31T23:59:59.999Z")));
    }

    #[test]
    fn an_offset_has_no_change_of_the_year() {
        let rule = ClockRule::Offset(19_800);
        let nominal = Nominal::of(at("2026-11-22T10:00:00"), rule, &TimeZone::UTC);
        assert_eq!(nominal, Nominal::Time(utc("2026-11-22T04:30:00Z")));
    }
}
