//! `watch` while events come faster and faster, in virtual time. Nothing is lost that the line
//! carries. Beyond that, most of what the line carries is delivered. Every event is delivered once
//! and in order, or counted as lost; the run itself checks that.

use ser_trial::watching::{Load, Watched, Way, line_carries};

const SECONDS: u32 = 60;

const WAYS: [Way; 2] = [Way::Reports, Way::Polling];

const LEAST_OF_WHAT_IS_CARRIED: f64 = 0.8;

fn watch(way: Way, size: u16, per_second: u32) -> Watched {
    Load { way, size, per_second, seconds: SECONDS }.run()
}

#[test]
fn nothing_is_lost_that_the_line_carries() {
    // At higher rates a ring of 64 entries turns over in less than a second, and withstands less.
    for (size, rates) in
        [(64, &[20, 40, 60][..]), (128, &[40, 70]), (256, &[40, 60, 70]), (2048, &[40, 70])]
    {
        for (&per_second, way) in rates.iter().flat_map(|rate| WAYS.map(|way| (rate, way))) {
            let watched = watch(way, size, per_second);
            assert_eq!(
                watched.lost, 0,
                "{per_second} events/s, ring of {size}, {way:?}: {watched:?}"
            );
            assert_eq!(watched.delivered, watched.events);
        }
    }
}

#[test]
fn a_watcher_with_reports_is_never_far_behind() {
    // With reports and readings on the line at once, a watcher falls further behind with every
    // second from 35 events/s on.
    for per_second in [10, 20, 30, 40, 50, 60] {
        let watched = watch(Way::Reports, 1024, per_second);
        let behind = watched.events - watched.in_time;
        assert!(behind <= per_second.into(), "{per_second} events/s: {behind} behind");
    }
}

#[test]
fn beyond_that_most_of_what_the_line_carries_is_delivered() {
    let carried = line_carries() * f64::from(SECONDS);
    for (size, per_second) in
        [(64, 200), (256, 80), (256, 500), (1024, 200), (1024, 500), (2048, 1000)]
    {
        for way in WAYS {
            let watched = watch(way, size, per_second);
            let part = watched.in_time as f64 / carried;
            let what = format!("{per_second} events/s, ring of {size}, {way:?}: {watched:?}");
            assert!(part >= LEAST_OF_WHAT_IS_CARRIED, "{what}, {part:.3}");
            assert_eq!(watched.delivered + watched.lost, watched.events, "{what}");
        }
    }
}
