//! Contacts move in exactly the millisecond that their scenario gives, however time is handed out.

use chrono::{NaiveDate, NaiveDateTime, TimeDelta};
use proptest::prelude::*;
use ser_node::Debounce;
use ser_proto::{
    Baud, Command, Configure, Decoded, Entry, FrameDecoder, FrameEncoder, Inputs, MAX_BODY_LEN,
    Model, Reply,
};
use ser_sim::{LineRate, NonVolatile, Ram, Scenario, SimNode, SimNodeOptions, SimRtc, Step};

fn power_up_time() -> NaiveDateTime {
    NaiveDate::from_ymd_opt(2026, 11, 22).unwrap().and_hms_milli_opt(23, 59, 58, 500).unwrap()
}

fn options(model: Model) -> SimNodeOptions {
    let non_volatile = NonVolatile { rtc: SimRtc::held_at(power_up_time()), ..NonVolatile::new() };
    SimNodeOptions { non_volatile, ..SimNodeOptions::new(model) }
}

fn step(at_ms: u64, input: u8, on: bool) -> Step {
    Step { at_ms, input, on }
}

fn replies(bytes: &[u8]) -> Vec<Reply> {
    let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
    let frames = bytes.iter().filter_map(|&byte| match decoder.push(byte) {
        Some(Decoded::Frame(body)) => {
            Some(Reply::parse(body).expect("the node speaks the protocol"))
        }
        _ => None,
    });
    frames.collect()
}

fn ask(node: &mut SimNode<'_>, command: &Command) -> Vec<Reply> {
    node.receive(&FrameEncoder::new(command.to_body()).collect::<Vec<u8>>());
    replies(&node.take_output())
}

/// The whole log.
fn log(node: &mut SimNode<'_>) -> Vec<Entry> {
    let mut entries = Vec::new();
    loop {
        let start = u16::try_from(entries.len() + 1).unwrap();
        match ask(node, &Command::Read { start, count: 10 }).as_slice() {
            [Reply::Read(reply)] if reply.entries.is_empty() => return entries,
            [Reply::Read(reply)] => entries.extend_from_slice(&reply.entries),
            other => panic!("not one read reply: {other:?}"),
        }
    }
}

/// The stamp of an event in the millisecond `at_ms` since power-up.
fn stamp(at_ms: u64) -> NaiveDateTime {
    power_up_time() + TimeDelta::milliseconds(i64::try_from(at_ms).unwrap())
}

#[test]
fn the_breaker_trip_is_recorded_to_the_millisecond_after_a_stall_of_seconds() {
    let mut ram = Ram::new();
    let mut node = SimNode::new(options(Model::Ser320), &mut ram);
    let scenario = Scenario::breaker_trip();
    node.advance_to(10);
    let start_ms = node.play(&scenario);
    assert_eq!(start_ms, 11);
    // The host is busy with something else for five seconds.
    node.advance_to(5000);
    assert!(node.is_idle());

    let mut expected: Vec<(NaiveDateTime, u32)> = Vec::new();
    for step in scenario.steps() {
        let (at, bit) = (stamp(start_ms + step.at_ms), 1 << (step.input - 1));
        match expected.last_mut() {
            Some((latest, changed)) if *latest == at => *changed |= bit,
            _ => expected.push((at, bit)),
        }
    }
    let log = log(&mut node);
    let recorded: Vec<_> = log
        .iter()
        .map(|entry| (NaiveDateTime::try_from(entry.time).unwrap(), entry.changed.0))
        .collect();
    assert_eq!(recorded, expected);
    let played: Vec<_> = node.take_played();
    assert_eq!(played.len(), log.len());
    for (played, entry) in played.iter().zip(&log) {
        assert_eq!((played.changed, played.state), (entry.changed, entry.state));
        assert_eq!(played.tick_before, played.tick_after);
        assert_eq!(
            stamp(played.tick_after.into()).to_string(),
            stamp(played.start_ms + played.at_ms).to_string()
        );
    }
}

#[test]
fn a_log_shows_what_reading_it_brings() {
    let mut ram = Ram::new();
    let mut node = SimNode::new(options(Model::Ser160), &mut ram);
    assert_eq!(node.log(), (0, vec![]));
    let small = Configure {
        size: Some(25),
        baud: None,
        auto_report: ser_proto::AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    ask(&mut node, &Command::Configure(small));
    // The log is not full, full to the last entry, or wrapped.
    for total in 1..=60 {
        node.play(&Scenario::from_steps([step(0, 1, total % 2 == 1)]));
        node.advance_to(u64::from(total) * 10);
        let mut by_number = log(&mut node);
        let oldest = if total < 25 { 0 } else { usize::from(total % 25) };
        by_number.rotate_left(oldest);
        assert_eq!(node.log(), (total, by_number));
    }
    ask(&mut node, &Command::Erase);
    assert_eq!(node.log(), (0, vec![]));
}

#[test]
fn contacts_at_power_up_are_the_baseline_and_a_power_cycle_forgets_the_log_and_keeps_the_configuration()
 {
    let mut ram = Ram::new();
    let mut node = SimNode::new(options(Model::Ser160), &mut ram);
    node.play(&Scenario::from_steps([step(0, 1, true), step(5, 2, true)]));
    node.advance_to(20);
    assert_eq!(log(&mut node).len(), 2);
    let configure = Configure {
        size: Some(100),
        baud: Some(Baud::B19200),
        auto_report: ser_proto::AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    assert_eq!(ask(&mut node, &Command::Configure(configure)).len(), 1);
    assert_eq!(node.baud(), Baud::B19200);

    let off = node.power_off();
    let mut node = off.power_up(&mut ram);
    assert_eq!(node.baud(), Baud::B19200);
    assert_eq!(node.now_ms(), 20);
    node.advance_to(40);
    assert_eq!(log(&mut node), []);
    node.play(&Scenario::from_steps([step(0, 1, false)]));
    node.advance_to(50);
    let log = log(&mut node);
    assert_eq!(log.len(), 1);
    // Input 2 was closed all the time.
    assert_eq!((log[0].changed, log[0].state), (Inputs(0b01), Inputs(0b10)));
    // The clock is held, so it shows the same time at every power-up.
    assert_eq!(NaiveDateTime::try_from(log[0].time).unwrap(), stamp(21));
}

#[test]
fn at_the_real_rate_a_byte_takes_ten_bit_times() {
    let mut ram = Ram::new();
    let options = SimNodeOptions { line_rate: LineRate::Real, ..options(Model::Ser160) };
    let mut node = SimNode::new(options, &mut ram);
    node.advance_to(10);
    node.receive(&FrameEncoder::new(Command::QueryMode.to_body()).collect::<Vec<u8>>());
    let mut arrived = Vec::new();
    for ms in 11..=30 {
        assert_eq!(replies(&arrived).len(), 0);
        node.advance_to(ms);
        arrived.extend(node.take_output());
        // 9600 bit/s: 1.04 ms per byte.
        assert_eq!(
            arrived.len(),
            usize::try_from((ms - 10) * 960 / 1000).unwrap().min(11),
            "at {ms} ms"
        );
        if arrived.len() == 11 {
            break;
        }
    }
    assert_eq!(replies(&arrived).len(), 1);
}

/// Any scenario of three inputs within a second.
fn scenario() -> impl Strategy<Value = Scenario> {
    let step = (0..1000_u64, 1..=3_u8, any::<bool>())
        .prop_map(|(at_ms, input, on)| step(at_ms, input, on));
    proptest::collection::vec(step, 0..60).prop_map(Scenario::from_steps)
}

proptest! {
    #[test]
    fn jumps_and_single_steps_give_the_same_log(
        scenario in scenario(),
        jumps in proptest::collection::vec(0..400_u64, 1..30),
        debounce_ms in prop_oneof![Just(0), 1..20_u8],
    ) {
        let play = |times: &mut dyn Iterator<Item = u64>| {
            let mut ram = Ram::new();
            let debounce = Debounce::uniform(debounce_ms);
            let mut node = SimNode::new(SimNodeOptions { debounce, ..options(Model::Ser160) }, &mut ram);
            node.play(&scenario);
            times.for_each(|ms| node.advance_to(ms));
            node.advance_to(1100);
            (log(&mut node), node.take_played(), node.diagnostics())
        };
        let by_steps = play(&mut (1..1100));
        let mut now_ms = 0;
        let mut by_jumps = jumps.iter().map(|jump| { now_ms += jump; now_ms.min(1100) });
        prop_assert_eq!(play(&mut by_jumps), by_steps);
    }
}
