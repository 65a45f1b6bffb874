//! What a host takes for certain of a recorder's clock that it asks, against the truth: the moment
//! at which the question arrived lies in the stated bounds, at every rate and whatever delays the
//! bytes. Recorder, line and host are simulated, in virtual time.

use std::time::Duration;

use ser_client::{ClockLook, Options, RequestError};
use ser_proto::{Baud, Capabilities, ClockReading, Model};
use ser_sim::SimNodeOptions;
use ser_trial::slow_line::{SlowLine, SlowWorld};

const PATIENCE: Options = Options { timeout: Duration::from_secs(1), retries: 0 };

/// Answers to so many questions at each rate; 0 answers are no test.
fn looks(line: SlowLine, questions: u32) -> Vec<(ClockLook, SlowWorld)> {
    let world = SlowWorld::new(line, SimNodeOptions::new(Model::Ser160));
    let mut unit = world.host(PATIENCE);
    // The first questions may be lost, too.
    while unit.identity().map_or(true, |identity| identity.is_none()) {
        unit = world.host(PATIENCE);
    }
    let mut answered = Vec::new();
    for _ in 0..questions {
        match unit.clock_look() {
            Ok(Some(look)) => answered.push((look, world.clone())),
            Ok(None) => panic!("it has said that it can be asked"),
            Err(RequestError::NoReply { .. }) => {}
            Err(error) => panic!("{error}"),
        }
        check_last(&answered);
    }
    answered
}

/// Checks the last answer against the truth.
fn check_last(answered: &[(ClockLook, SlowWorld)]) {
    let Some((look, world)) = answered.last() else { return };
    let ClockLook { reading, between: (from, to) } = *look;
    let ClockReading { tick_us, .. } = reading;
    let arrived = world.when_tick_was(tick_us);
    assert!(world.was_an_arrival(arrived), "no byte arrived at {arrived:?}");
    // The recorder counts whole microseconds, of its own.
    let (least, most) = (from.saturating_sub(Duration::from_micros(2)), to);
    assert!((least..=most).contains(&arrived), "{arrived:?} is not in {from:?}..={to:?}");
}

#[test]
fn the_moment_of_a_reading_is_within_its_bounds_whatever_delays_the_bytes() {
    let mut rounds = 0;
    for (seed, baud) in (1..).zip([Baud::B300, Baud::B1200, Baud::B9600, Baud::B19200]) {
        let quiet = SlowLine { seed, ..SlowLine::quiet(baud) };
        let away = Duration::from_millis(40);
        for line in [
            quiet,
            SlowLine { fast_ppm: 50, phase_ns: 999_999, ..quiet },
            SlowLine { adapter: Some(Duration::from_millis(16)), ..quiet },
            SlowLine { host_away: away, fast_ppm: -50, ..quiet },
            SlowLine { recorder_away: away, ..quiet },
            SlowLine { loses: 3, holds_up: 3, ..quiet },
            SlowLine {
                adapter: Some(Duration::from_millis(16)),
                host_away: away,
                recorder_away: away,
                loses: 5,
                holds_up: 5,
                ..quiet
            },
        ] {
            let answered = looks(line, 360);
            assert!(answered.len() >= 100, "{line:?}: only {} were answered", answered.len());
            rounds += 360;
        }
    }
    assert!(rounds >= 10_000, "{rounds}");
}

#[test]
fn at_9600_and_with_a_quiet_host_a_reading_is_certain_to_two_milliseconds() {
    for phase_ns in (0..1_000_000).step_by(100_000) {
        let line = SlowLine { phase_ns, ..SlowLine::quiet(Baud::B9600) };
        for (look, _) in looks(line, 20) {
            let (from, to) = look.between;
            assert!(to - from <= Duration::from_millis(2), "{:?}", to - from);
        }
    }
}

#[test]
fn what_an_adapter_holds_back_is_part_of_the_way_back_only() {
    let line =
        SlowLine { adapter: Some(Duration::from_millis(16)), ..SlowLine::quiet(Baud::B9600) };
    for (look, world) in looks(line, 50) {
        let (from, to) = look.between;
        let arrived = world.when_tick_was(look.reading.tick_us);
        assert!(arrived - from <= Duration::from_millis(1), "{from:?} {arrived:?}");
        assert!(to - arrived <= Duration::from_millis(18), "{arrived:?} {to:?}");
    }
}

#[test]
fn a_recorder_of_ours_says_what_it_can_be_asked() {
    let world = SlowWorld::new(SlowLine::quiet(Baud::B19200), SimNodeOptions::new(Model::Ser320));
    let mut unit = world.host(PATIENCE);
    let identity = unit.identity().unwrap().expect("one of ours");
    assert_eq!(identity.model, Model::Ser320);
    assert!(identity.capabilities.contains(Capabilities::TIME));
    assert_eq!(unit.filters().unwrap().map(|filters| filters.len()), Some(32));
    assert!(unit.recorder_counters().unwrap().is_some_and(|counters| counters.len() >= 48));
}
