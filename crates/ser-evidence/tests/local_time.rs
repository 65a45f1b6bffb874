//! Clocks that show local time, over the changes of the year and of the century.

mod common;

use common::{Log, history, monotonic_us, seen, site};
use ser_evidence::clock::Nominal;
use ser_evidence::record::How;
use ser_evidence::time::{Moment, Utc};
use ser_evidence::timeline::{ChangeId, EventId, Timeline};

const LOCAL: &str = "
[[recorder]]
name = \"U1\"
clock = \"local\"
";

fn utc(text: &str) -> Moment<Utc> {
    Moment::from_us(seen(text).us())
}

fn with_timeline(log: &Log, check: impl FnOnce(&Timeline<'_>, Vec<EventId>)) {
    let site = site(LOCAL);
    let history = history(&site, &[log]);
    let timeline = Timeline::new(&site, &history);
    let events = timeline.entries().collect();
    check(&timeline, events);
}

#[test]
fn a_clock_that_was_set_in_summer_keeps_summer_time_in_winter() {
    let mut u1 = Log::of("U1", 1);
    let at = monotonic_us("2026-07-01T10:00:00.000");
    // Noon in Berlin.
    u1.observed(
        How::Set { broadcast: None },
        "2026-07-01T12:00:00.000",
        (at, at + 2_000),
        Some(1_000),
    );
    u1.changes("2026-07-02T12:00:00.000", &[1]).changes("2026-12-01T12:00:00.000", &[2]);
    with_timeline(&u1, |timeline, events| {
        for (event, time) in
            [(events[0], "2026-07-02T10:00:00.000"), (events[1], "2026-12-01T10:00:00.000")]
        {
            let moved = timeline.moved_utc(event, None);
            assert!(moved.contains(utc(time)), "{moved:?} {time}");
            let key = timeline.sort_key(event).unwrap();
            // 153 days of 50 ppm are eleven minutes, and not an hour.
            assert!(key.abs_diff(utc(time).us()) < 700_000_000, "{key}");
        }
    });
}

#[test]
fn an_hour_that_comes_twice_is_told_apart_by_its_neighbours() {
    let mut u1 = Log::of("U1", 1);
    u1.changes("2026-10-25T01:50:00.000", &[1]);
    u1.changes("2026-10-25T02:30:00.000", &[1]);
    // The clock was set back by an hour here.
    u1.changes("2026-10-25T02:10:00.000", &[1]);
    u1.changes("2026-10-25T03:10:00.000", &[1]);
    with_timeline(&u1, |timeline, events| {
        let of = |place: usize| timeline.nominal(events[place]);
        assert_eq!(of(0), Nominal::Time(utc("2026-10-24T23:50:00.000")));
        assert_eq!(of(3), Nominal::Time(utc("2026-10-25T02:10:00.000")));
        let (early, late) = (utc("2026-10-25T00:30:00.000"), utc("2026-10-25T01:30:00.000"));
        assert_eq!(of(1), Nominal::Ambiguous(early, late), "both, if nothing between tells");
    });
}

#[test]
fn a_lone_hour_that_comes_twice_is_both_and_one_that_is_left_out_is_kept() {
    let mut u1 = Log::of("U1", 1);
    u1.changes("2026-10-25T02:30:00.000", &[1]);
    with_timeline(&u1, |timeline, events| {
        let (early, late) = (utc("2026-10-25T00:30:00.000"), utc("2026-10-25T01:30:00.000"));
        assert_eq!(timeline.nominal(events[0]), Nominal::Ambiguous(early, late));
    });
    let mut u1 = Log::of("U1", 1);
    u1.changes("2026-03-29T02:30:00.000", &[1]);
    with_timeline(&u1, |timeline, events| {
        let as_if = utc("2026-03-29T01:30:00.000");
        assert_eq!(timeline.nominal(events[0]), Nominal::Missing(as_if));
    });
}

#[test]
fn the_turns_of_the_centuries_are_a_millisecond_long() {
    for (before, after) in [
        ("1999-12-31T23:59:59.999", "2000-01-01T00:00:00.000"),
        ("2069-12-31T23:59:59.999", "1970-01-01T00:00:00.000"),
    ] {
        let mut u1 = Log::of("U1", 1);
        u1.changes(before, &[1]).changes(after, &[2]);
        with_timeline(&u1, |timeline, events| {
            let change = |place: usize, input| ChangeId { event: events[place], input };
            let delta = timeline.delta(change(0, 1), change(1, 2));
            assert_eq!(delta.middle_us(), Some(1000), "{before} {after}");
            for event in &events {
                assert_ne!(timeline.nominal(*event), Nominal::NotKnown, "{before} {after}");
            }
        });
    }
}

#[test]
fn a_clock_that_was_never_set_is_at_the_end_and_has_no_time() {
    let mut u1 = Log::of("U1", 1);
    u1.changes("1970-01-01T00:00:07.000", &[1]).changes("1970-01-01T00:00:08.000", &[1]);
    with_timeline(&u1, |timeline, events| {
        assert_eq!(events.len(), 2);
        for event in events {
            assert_eq!(timeline.sort_key(event), None);
            assert_eq!(timeline.nominal(event), Nominal::NotKnown);
        }
    });
}
