//! From a time as it is written to UTC.
//!
//! The order of a date is taken from the file where all of its dates leave one possibility, and asked
//! for where they do not. An hour that comes twice is told apart by the rows around it; where they
//! do not, the row is kept with the earlier one and says so.

use std::collections::{BTreeSet, HashSet};

use jiff::tz::{AmbiguousOffset, Offset, TimeZone};

use super::calendar::{Date, DateOrder, utc_offset};
use super::list::{List, When};
use super::notes::{Notes, Refusal};

/// The first and the last year that a stamp can have.
const YEARS: std::ops::RangeInclusive<i16> = 1970..=2069;

/// Understands the name of a zone, such as `Europe/Berlin` or `UTC`, or an offset such as `+05:30`.
#[must_use]
pub fn zone_named(text: &str) -> Option<TimeZone> {
    if let Some(seconds) = utc_offset(text) {
        return Some(Offset::from_seconds(seconds).ok()?.to_time_zone());
    }
    TimeZone::get(text).ok()
}

/// A moment in UTC, in nanoseconds since 1970, and what is doubtful about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Utc {
    pub(super) ns: i64,
    pub(super) doubt: Option<Doubt>,
}

/// What is doubtful about a local time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Doubt {
    /// The hour came twice. It may as well be this much later, in nanoseconds.
    Twice(i64),
    /// The hour was left out. It is reckoned as if the zone had not changed.
    Missing,
}

/// The order of the dates in lists of one file.
pub(super) fn date_order(
    lists: &[List],
    chosen: Option<DateOrder>,
    notes: &mut Notes,
) -> Result<DateOrder, Refusal> {
    if let Some(chosen) = chosen {
        return Ok(chosen);
    }
    let dates = lists.iter().flat_map(|list| {
        list.rows.iter().map(|row| row.when.date).chain(list.other_dates.iter().copied())
    });
    let is_one = |date: &Date| DateOrder::ALL.iter().any(|order| date.in_order(*order).is_some());
    let dates: HashSet<Date> = dates.filter(is_one).collect();
    let mut dates: Vec<Date> = dates.into_iter().collect();
    dates.sort_unstable_by_key(ToString::to_string);
    let fits = |order: &DateOrder| dates.iter().all(|date| date.in_order(*order).is_some());
    if let Some(usual) = lists.iter().find_map(|list| list.usual_dates).filter(fits) {
        return Ok(usual);
    }
    let possible: Vec<DateOrder> = DateOrder::ALL.into_iter().filter(fits).collect();
    let readings: BTreeSet<Vec<String>> = possible
        .iter()
        .map(|order| dates.iter().map(|date| format!("{:?}", date.in_order(*order))).collect())
        .collect();
    match (possible.first(), readings.len()) {
        (Some(first), 1) => {
            tell_order(&dates, *first, notes);
            Ok(*first)
        }
        _ => {
            let example = dates.first().map_or_else(String::new, ToString::to_string);
            let possible = if possible.is_empty() { DateOrder::ALL.to_vec() } else { possible };
            Err(Refusal::NoDates { example, possible })
        }
    }
}

/// Says which date decides the order, unless the year is written first in full.
fn tell_order(dates: &[Date], order: DateOrder, notes: &mut Notes) {
    let others = |date: &&Date| {
        let is_possible = |other: &&DateOrder| date.in_order(**other).is_some();
        DateOrder::ALL.iter().filter(is_possible).count() == 1
    };
    if let Some(decisive) = dates.iter().find(others).filter(|_| order != DateOrder::Ymd) {
        let order = order.in_words();
        notes.remark(None, format!("dates are read as {order}, because of {decisive}"));
    }
}

/// What each row of a list is in UTC. `None` for dates that are none, which are told.
pub(super) fn in_utc(
    list: &List,
    order: DateOrder,
    zone: Option<&TimeZone>,
    notes: &mut Notes,
) -> Result<Vec<Option<Utc>>, Refusal> {
    let mut times = Vec::with_capacity(list.rows.len());
    for row in &list.rows {
        let time = match local_ns(&row.when, order) {
            None => {
                notes.leave_out(row.line, no_date(row.when.date, order));
                None
            }
            Some(local) => Some(Local { ns: local, ..Local::of(local, &row.when, zone)? }),
        };
        times.push(time);
    }
    tell_apart(&mut times);
    Ok(times.iter().zip(&list.rows).map(|(time, row)| Some((*time)?.utc(&row.when))).collect())
}

/// Why a date is none.
fn no_date(date: Date, order: DateOrder) -> String {
    if date.in_order(order).is_some() {
        return format!("{date} is not a date from 1970 to 2069");
    }
    let other = DateOrder::ALL.into_iter().find(|other| date.in_order(*other).is_some());
    let other = other.map(|other| format!("; it is one with --dates {other}")).unwrap_or_default();
    format!("{date} is not a date in the order {}{other}", order.in_words())
}

/// Nanoseconds from 1970 as a clock in that place counts them.
fn local_ns(when: &When, order: DateOrder) -> Option<i64> {
    let date = when.date.in_order(order).filter(|date| YEARS.contains(&date.year()))?;
    let midnight = Offset::UTC.to_timestamp(date.at(0, 0, 0, 0)).ok()?.as_second();
    midnight.checked_mul(1_000_000_000)?.checked_add(i64::try_from(when.day_ns).ok()?)
}

/// A local time and the offsets that it may have, in nanoseconds.
#[derive(Clone, Copy, Debug)]
struct Local {
    ns: i64,
    /// The one that is taken.
    offset: i64,
    /// The later one of an hour that came twice, as long as nothing decides.
    other: Option<i64>,
    is_missing: bool,
}

impl Local {
    fn of(ns: i64, when: &When, zone: Option<&TimeZone>) -> Result<Local, Refusal> {
        let fixed = |seconds: i32| Local {
            ns,
            offset: i64::from(seconds) * 1_000_000_000,
            other: None,
            is_missing: false,
        };
        if let Some(seconds) = when.utc_offset_s {
            return Ok(fixed(seconds));
        }
        let zone = zone.ok_or(Refusal::NoZone)?;
        let timestamp = jiff::Timestamp::from_nanosecond(ns.into()).ok();
        let civil = timestamp.map(|at| Offset::UTC.to_datetime(at)).ok_or(Refusal::NoZone)?;
        Ok(match zone.to_ambiguous_timestamp(civil).offset() {
            AmbiguousOffset::Unambiguous { offset } => fixed(offset.seconds()),
            AmbiguousOffset::Fold { before, after } => Local {
                other: Some(i64::from(after.seconds()) * 1_000_000_000),
                ..fixed(before.seconds())
            },
            AmbiguousOffset::Gap { before, .. } => {
                Local { is_missing: true, ..fixed(before.seconds()) }
            }
        })
    }

    /// In UTC, as long as nothing decides the earlier one.
    const fn taken(self) -> i64 {
        self.ns.saturating_sub(self.offset)
    }

    /// In UTC, the later one if there are two.
    fn latest(self) -> i64 {
        self.ns.saturating_sub(self.other.unwrap_or(self.offset))
    }

    fn decide(&mut self, is_later: bool) {
        if let (Some(later), true) = (self.other.take(), is_later) {
            self.offset = later;
        }
    }

    fn utc(self, when: &When) -> Utc {
        let doubt = match self.other {
            Some(other) => Some(Doubt::Twice(self.offset.saturating_sub(other))),
            None => self.is_missing.then_some(Doubt::Missing),
        };
        Utc { ns: self.taken().saturating_add(when.later_ns), doubt }
    }
}

/// Decides which of two hours it is where the rows before and after tell.
fn tell_apart(times: &mut [Option<Local>]) {
    // Where the clock goes back, the second hour begins.
    let mut previous: Option<usize> = None;
    for place in 0..times.len() {
        let Some(now) = times.get(place).copied().flatten() else { continue };
        let before = previous.and_then(|place| times.get(place).copied().flatten());
        if let (Some(before), Some(at)) = (before, previous)
            && before.other.is_some()
            && now.other.is_some()
            && now.ns < before.ns
        {
            decide(times, at, false);
            decide(times, place, true);
        }
        previous = Some(place);
    }
    let mut last = i64::MIN;
    for time in times.iter_mut().flatten() {
        if time.other.is_some() && last > time.taken() {
            time.decide(true);
        }
        last = if time.other.is_some() { last } else { time.taken() };
    }
    let mut next = i64::MAX;
    for time in times.iter_mut().rev().flatten() {
        if time.other.is_some() && next < time.latest() {
            time.decide(false);
        }
        next = if time.other.is_some() { next } else { time.taken() };
    }
}

fn decide(times: &mut [Option<Local>], place: usize, is_later: bool) {
    if let Some(Some(time)) = times.get_mut(place) {
        time.decide(is_later);
    }
}

#[cfg(test)]
mod tests {
    use super::super::calendar::time_of_day;
    use super::super::list::Row;
    use super::*;

    fn list(rows: &[&str]) -> List {
        let row = |(place, text): (u64, &&str)| {
            let (date, time) = text.split_once(' ').unwrap();
            let date = Date::parse(date).unwrap();
            let day_ns = time_of_day(time).unwrap();
            let when = When { date, day_ns, later_ns: 0, utc_offset_s: None };
            Row {
                line: place,
                when,
                place,
                forgets: false,
                torn: None,
                learnt: vec![],
                changes: vec![],
            }
        };
        List { rows: (1..).zip(rows).map(row).collect(), ..List::default() }
    }

    fn utc(zone: &str, rows: &[&str]) -> Vec<String> {
        let zone = zone_named(zone).unwrap();
        let list = list(rows);
        let times = in_utc(&list, DateOrder::Ymd, Some(&zone), &mut Notes::default()).unwrap();
        let shown = |time: Option<Utc>| {
            let time = time.unwrap();
            let at = jiff::Timestamp::from_nanosecond(time.ns.into()).unwrap();
            match time.doubt {
                None => format!("{at:.3}"),
                Some(Doubt::Twice(ns)) => format!("{at:.3} or {} s later", ns / 1_000_000_000),
                Some(Doubt::Missing) => format!("{at:.3} missing"),
            }
        };
        times.into_iter().map(shown).collect()
    }

    #[test]
    fn an_hour_that_comes_twice_is_told_apart_by_its_neighbours() {
        assert_eq!(
            utc("America/Chicago", &["2026-11-01 01:59:59.990", "2026-11-01 01:00:00.010"]),
            ["2026-11-01T06:59:59.990Z", "2026-11-01T07:00:00.010Z"]
        );
        // Neither the row before nor the one after is in that hour.
        assert_eq!(
            utc(
                "Europe/Berlin",
                &["2026-10-25 01:00:00.000", "2026-10-25 02:30:00.000", "2026-10-25 04:00:00.000"]
            )[1],
            "2026-10-25T00:30:00.000Z or 3600 s later"
        );
        // What is before an earlier one is earlier, what is after a later one is later.
        assert_eq!(
            utc(
                "Europe/Berlin",
                &[
                    "2026-10-25 02:10:00.000",
                    "2026-10-25 02:50:00.000",
                    "2026-10-25 02:20:00.000",
                    "2026-10-25 02:40:00.000"
                ]
            ),
            [
                "2026-10-25T00:10:00.000Z",
                "2026-10-25T00:50:00.000Z",
                "2026-10-25T01:20:00.000Z",
                "2026-10-25T01:40:00.000Z"
            ]
        );
    }

    #[test]
    fn a_date_in_another_order_is_told_with_that_order() {
        let told = |date, order| no_date(Date::parse(date).unwrap(), order);
        assert_eq!(
            told("22/11/2026", DateOrder::Mdy),
            "22/11/2026 is not a date in the order month, day, year; it is one with --dates dmy"
        );
        assert_eq!(
            told("22/11/1950", DateOrder::Dmy),
            "22/11/1950 is not a date from 1970 to 2069"
        );
    }

    #[test]
    fn an_hour_that_is_left_out_is_kept_and_marked() {
        assert_eq!(
            utc("Europe/Berlin", &["2026-03-29 02:30:00.000"]),
            ["2026-03-29T01:30:00.000Z missing"]
        );
    }

    #[test]
    fn a_zone_may_be_an_offset() {
        let rows = ["2026-11-22 10:00:00.250"];
        for (zone, expected) in [
            ("UTC", "2026-11-22T10:00:00.250Z"),
            ("+05:30", "2026-11-22T04:30:00.250Z"),
            ("-6", "2026-11-22T16:00:00.250Z"),
            ("Europe/Berlin", "2026-11-22T09:00:00.250Z"),
        ] {
            assert_eq!(utc(zone, &rows), [expected], "{zone}");
        }
        assert!(zone_named("Europe/Berlln").is_none());
        let none = in_utc(&list(&rows), DateOrder::Ymd, None, &mut Notes::default());
        assert!(matches!(none, Err(Refusal::NoZone)));
    }

    fn order(rows: &[&str]) -> Result<DateOrder, Vec<DateOrder>> {
        date_order(&[list(rows)], None, &mut Notes::default()).map_err(|refusal| match refusal {
            Refusal::NoDates { possible, .. } => possible,
            other => panic!("{other}"),
        })
    }

    #[test]
    fn the_order_of_dates_is_proven_or_asked_for() {
        use DateOrder::{Dmy, Mdy, Ymd};
        assert_eq!(order(&["11/12/2026 10:00:00.000", "11/22/2026 10:00:00.000"]), Ok(Mdy));
        assert_eq!(order(&["22.11.2026 10:00:00.000"]), Ok(Dmy));
        assert_eq!(order(&["2026-11-12 10:00:00.000"]), Ok(Ymd));
        assert_eq!(order(&["11/11/2026 10:00:00.000"]), Ok(Mdy), "either is the same day");
        assert_eq!(order(&["11/12/2026 10:00:00.000"]), Err(vec![Mdy, Dmy]));
        assert_eq!(order(&["26/11/22 10:00:00.000"]), Err(vec![Dmy, Ymd]));
        assert_eq!(
            order(&["11/22/2026 10:00:00.000", "22/11/2026 10:00:00.000"]),
            Err(vec![Mdy, Dmy, Ymd]),
            "they contradict each other"
        );
    }
}
