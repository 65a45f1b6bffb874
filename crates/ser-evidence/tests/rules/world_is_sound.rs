//! Tests of the worlds themselves: what they tell is true, and everything that can happen does.

use std::collections::BTreeMap;

use ser_evidence::record::{How, Record, Reference};
use ser_evidence::time::{Moment, shown};

use crate::recorder::{SamplePlace, TrueEntry, TrueRecorder};
use crate::story::Story;
use crate::true_time::{MS, Ps, US, ceil_us, floor_us};

fn stories() -> impl Iterator<Item = Story> {
    (0..200).map(Story::of)
}

fn recorders(story: &Story) -> &[TrueRecorder] {
    &story.world.recorders
}

#[test]
fn states_follow_from_each_other_where_nothing_is_left_out() {
    for story in stories() {
        for recorder in recorders(&story) {
            let neighbours = recorder.entries.windows(2).filter(|two| two[0].life == two[1].life);
            for two in neighbours {
                let Ok([one, other]) = <&[TrueEntry; 2]>::try_from(two) else { unreachable!() };
                assert_eq!(one.total + 1, other.total, "seed {}", story.world.seed);
                assert!(one.sampled < other.sampled, "seed {}", story.world.seed);
                let is_whole = one.entry.state.0 ^ other.entry.changed.0 == other.entry.state.0;
                let is_stopped = !recorder.build.schedule.stops.is_empty();
                assert!(is_whole || is_stopped, "seed {}", story.world.seed);
            }
        }
    }
}

#[test]
fn stamps_rise_while_the_clock_is_not_set() {
    for story in stories() {
        for recorder in recorders(&story) {
            for two in recorder.entries.windows(2) {
                let powers = [&two[0], &two[1]].map(|entry| recorder.lives[entry.life].power);
                let is_one_run =
                    powers[0] == powers[1] && two[0].shown.setting == two[1].shown.setting;
                assert!(
                    !is_one_run || two[0].shown.shown_ms < two[1].shown.shown_ms,
                    "seed {}",
                    story.world.seed
                );
            }
        }
    }
}

#[test]
fn a_stamp_is_what_the_clock_showed() {
    for story in stories() {
        for entry in recorders(&story).iter().flat_map(|recorder| &recorder.entries) {
            let read = shown(&entry.entry.time).expect("a date");
            assert_eq!(read, Moment::from_us(entry.shown.shown_ms * 1000));
        }
    }
}

/// The rule by which moments are found from samples. A millisecond of a slow clock is a little
/// longer than one.
#[test]
fn contacts_moved_within_a_millisecond_and_the_delays_before_the_sample() {
    const LONGER: Ps = US;
    for story in stories() {
        for recorder in recorders(&story) {
            let delays = recorder.build.site.delays;
            let more = if recorder.build.site.is_original { MS } else { 0 };
            for entry in &recorder.entries {
                assert!(!entry.moves.is_empty(), "seed {}", story.world.seed);
                for seen in &entry.moves {
                    let is_on = entry.entry.state.contains(seen.input);
                    let (shortest, longest) =
                        if is_on { delays.closing_us } else { delays.opening_us };
                    let tick = entry.shown.began;
                    let first = tick - MS - Ps::from(longest) * US - LONGER;
                    let last = tick + more - Ps::from(shortest) * US;
                    assert!(
                        first < seen.at && seen.at <= last,
                        "seed {}: {seen:?} at tick {tick}",
                        story.world.seed
                    );
                }
            }
        }
    }
}

#[test]
fn samples_are_where_they_are_said_to_be() {
    for story in stories() {
        for recorder in recorders(&story) {
            for entry in &recorder.entries {
                let later = entry.sampled - entry.shown.began;
                match recorder.build.sample_place {
                    SamplePlace::AtTheTick => assert_eq!(later, 0),
                    SamplePlace::Later(much) => assert_eq!(later, much),
                    SamplePlace::Anywhere(_) => assert!((0..MS).contains(&later)),
                }
            }
        }
    }
}

#[test]
fn clocks_drift_and_wander_no_more_than_the_site_says() {
    for story in stories() {
        for recorder in recorders(&story) {
            let drift = i64::from(recorder.build.site.drift_ppb);
            let wander = i64::from(recorder.build.site.wander_ppb);
            for entry in &recorder.entries {
                let ticks = &recorder.clocks[recorder.lives[entry.life].power].ticks;
                let rate = ticks.rate_ppb(ticks.at(entry.sampled));
                assert!(rate.abs() <= drift, "seed {}", story.world.seed);
                let off = rate - recorder.build.rate_ppb;
                assert!(2 * off.abs() <= wander, "seed {}", story.world.seed);
            }
        }
    }
}

#[test]
fn the_truth_is_in_the_bound_of_every_observation() {
    for story in stories() {
        for observed in &story.observed {
            let Reference::Host { bound, reading } = observed.observation.at else {
                panic!("hosts observe");
            };
            let mut hosts = story.world.hosts.iter();
            let host = hosts.find(|host| host.boot == reading.boot).expect("a host");
            let began = observed.shown.began;
            let mut shifts = story.world.site.shifts.iter();
            let shift = shifts.find(|shift| shift.recorder.0 == observed.recorder);
            let off_us = shift.map_or(0, |shift| -shift.us);
            let began = Moment::from_us(host.monotonic_us(began)).after(off_us);
            assert!(bound.contains(began), "seed {}: {observed:?}", story.world.seed);
            let shown_ms = observed.shown.shown_ms;
            assert_eq!(observed.observation.shown, Moment::from_us(shown_ms * 1000));
        }
    }
}

#[test]
fn the_place_of_an_observation_is_true() {
    for story in stories() {
        for observed in &story.observed {
            let recorder = &recorders(&story)[observed.recorder];
            let power = recorder.lives[observed.life].power;
            let mine = recorder.entries.iter().filter(|entry| entry.life == observed.life);
            let is_set = observed.observation.how.is_set();
            for entry in mine {
                let entry_is_later = entry.shown.setting > observed.shown.setting;
                let entry_is_earlier = if is_set {
                    entry.shown.setting < observed.shown.setting
                } else {
                    entry.shown.began < observed.shown.began
                };
                let (after, before) = observed.totals;
                assert!(
                    !(entry_is_later && entry.total <= after && is_set),
                    "seed {}: {observed:?} in power-up {power}",
                    story.world.seed
                );
                assert!(
                    !(entry_is_earlier && entry.total > before),
                    "seed {}: {observed:?} {entry:?} in power-up {power}",
                    story.world.seed
                );
            }
        }
    }
}

#[test]
fn a_hosts_utc_is_as_wrong_as_it_says() {
    for story in stories() {
        for told in story.records() {
            let Record::Clock(observation) = told.record else { continue };
            let Reference::Host { reading, .. } = observation.at else { continue };
            let mut hosts = story.world.hosts.iter();
            let host = hosts.find(|host| host.boot == reading.boot).expect("a host");
            let Some(doubt) = host.doubt_us(story.world.site.utc_doubt_us) else { continue };
            let truth = story.world.start_utc_us + floor_us(host.instant(reading.monotonic));
            assert!((reading.utc.us() - truth).unsigned_abs() <= doubt);
        }
        for hand in &story.world.site.observations {
            let shown = hand.unit_time.us() / 1000;
            let recorder = &recorders(&story)[hand.recorder.0];
            let setting = recorder.clocks[0].settings[0];
            let began = recorder.clocks[0].ticks.instant(shown - setting.shown_ms);
            let mut shifts = story.world.site.shifts.iter();
            let shift = shifts.find(|shift| shift.recorder == hand.recorder);
            let off_us = shift.map_or(0, |shift| -shift.us);
            let truth = story.world.start_utc_us + ceil_us(began) + off_us;
            assert!((hand.host_time.us() - truth).unsigned_abs() <= hand.doubt_us + 1);
        }
    }
}

/// A generator that never draws something proves nothing about it.
#[test]
fn everything_that_can_happen_does() {
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut count = |what, number| *seen.entry(what).or_default() += number;
    for story in stories() {
        count("planted", usize::from(story.planted.is_some()));
        for recorder in recorders(&story) {
            count("entries", recorder.entries.len());
            count("power failures", recorder.clocks.len() - 1);
            let erased = recorder.lives.iter().filter(|life| life.erased.is_some());
            count("erases that are told", erased.count());
            let several = recorder.entries.iter().filter(|entry| entry.moves.len() > 1);
            count("several inputs in a sample", several.count());
        }
        for told in story.records() {
            match told.record {
                Record::Gap(gap) => count(
                    match gap.why {
                        ser_evidence::record::Why::Overwritten => "overwritten",
                        ser_evidence::record::Why::LogBeganAnew => "began anew",
                        ser_evidence::record::Why::NotRecorded(_) => "not recorded",
                        ser_evidence::record::Why::NotReached => "not reached",
                        ser_evidence::record::Why::Unreadable => "unreadable",
                        ser_evidence::record::Why::Expired => "expired",
                    },
                    1,
                ),
                Record::Clock(observation) => {
                    count(how(observation.how), 1);
                    let (after, before) = (observation.place.after, observation.place.before);
                    count("ambiguous place", usize::from(after != before));
                }
                Record::Entry(entry) if !entry.life.is_known() => count("without a life", 1),
                Record::Watched(_) => count("watched", 1),
                Record::Step(_) => count("step", 1),
                Record::Entry(entry) if entry.known == entry.entry.changed => {
                    count("changes only", 1);
                }
                // No recorder of ours knows a name, and none of this world leaves anything out, nor
                // does anybody write to an archive or write down who sent a command: the last six
                // are never there.
                Record::Entry(_)
                | Record::Life(_)
                | Record::Point(_)
                | Record::Recorder(_)
                | Record::Suppressed(_)
                | Record::Command(_)
                | Record::Note(_)
                | Record::Site(_) => {}
            }
        }
        count("shifts", story.world.site.shifts.len());
        count("hand", story.world.site.observations.len());
        let pairs = story.world.site.points.iter().filter(|point| point.same_as.is_some());
        count("pairs", pairs.count());
    }
    let rare: Vec<_> = seen.iter().filter(|&(_, &count)| count < 5).collect();
    assert!(seen.len() == 21 && rare.is_empty(), "{seen:#?}");
}

fn how(how: How) -> &'static str {
    match how {
        How::Set { broadcast: None } => "set",
        How::Set { broadcast: Some(_) } => "broadcast set",
        How::Mark { .. } => "mark",
        How::Query => "query",
        How::Event => "event",
        How::Hand => "hand",
    }
}
