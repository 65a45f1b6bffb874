//! The commands that the manual does not have: who a recorder is, what its clock shows, how it
//! filters, and what it counted.

mod bench;

use std::num::NonZeroU8;

use bench::{Bench, Survivors, TEN_O_CLOCK, changes};
use ser_node::{Debounce, TickStamp};
use ser_proto::{
    Capabilities, ChatterFilter, ClockReading, ClockSource, Command, Configuration, Configure,
    Counter, Filters, FrameEncoder, Identity, InputFilter, Model, RecorderId, Reply,
};

/// 2026-11-22 10:00:00 in microseconds since 1970.
const TEN_O_CLOCK_US: i64 = 1_795_341_600_000_000;

fn identity(bench: &mut Bench) -> Identity {
    match bench.ask(&Command::Identify)[..] {
        [Reply::Identity(identity)] => identity,
        ref other => panic!("not one identity: {other:?}"),
    }
}

fn filters(bench: &mut Bench, command: &Command) -> Filters {
    match &bench.ask(command)[..] {
        [Reply::Filters(filters)] => filters.clone(),
        other => panic!("not one page of filters: {other:?}"),
    }
}

fn reading(bench: &mut Bench, token: u16) -> ClockReading {
    match bench.ask(&Command::Time { token })[..] {
        [Reply::Time(reading)] => reading,
        ref other => panic!("not one reading: {other:?}"),
    }
}

fn input(number: u8) -> NonZeroU8 {
    NonZeroU8::new(number).unwrap()
}

fn chatter(changes: u8, window_ms: u16, rearm_ms: u16) -> Option<ChatterFilter> {
    Some(ChatterFilter { changes: input(changes), window_ms, rearm_ms })
}

/// All counters that there are.
fn counters(bench: &mut Bench) -> Vec<(Counter, u32)> {
    let (mut all, mut next) = (Vec::new(), Some(Counter::FIRST));
    while let Some(first) = next {
        let replies = bench.ask(&Command::Diagnostics { first });
        let [Reply::Diagnostics(page)] = &replies[..] else { panic!("{replies:?}") };
        all.extend(page.counters());
        next = page.next;
    }
    all
}

// I: identity

#[test]
fn a_recorder_says_who_it_is_and_counts_power_ups_and_lives_for_ever() {
    let id = RecorderId::new(*b"number 12345");
    let survivors = Survivors { id, ..Survivors::default() };
    let power_up = || Bench::with(Model::Ser160, Debounce::OFF, 512, survivors.clone());
    let counts = |bench: &mut Bench| {
        let Identity { power_ups, life, .. } = identity(bench);
        (power_ups, life)
    };
    let mut bench = power_up();
    let Identity { model, log_capacity, capabilities, .. } = identity(&mut bench);
    assert_eq!((identity(&mut bench).id, model, log_capacity), (id, Model::Ser160, 512));
    assert!(capabilities.contains(Capabilities::LASTING_COUNTS));
    assert_eq!(counts(&mut bench), (1, 1));
    bench.ask(&Command::Erase);
    assert_eq!(counts(&mut bench), (1, 2), "another life of the log");
    let mut bench = power_up();
    assert_eq!(counts(&mut bench), (2, 3));
}

#[test]
fn a_recorder_that_cannot_keep_its_counts_says_so() {
    let survivors = Survivors::default();
    *survivors.write_protected.borrow_mut() = true;
    let mut bench = Bench::with(Model::Ser320, Debounce::OFF, 16, survivors);
    let Identity { capabilities, power_ups, life, id, .. } = identity(&mut bench);
    assert!(!capabilities.contains(Capabilities::LASTING_COUNTS));
    assert_eq!((power_ups, life, id), (1, 1, None));
    assert_eq!(bench.diagnostics().storage_errors, 1);
}

// T: time

#[test]
fn the_clock_is_told_as_of_the_arrival_of_the_last_byte_however_late_the_reply_is() {
    let mut bench = Bench::new(Model::Ser160);
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.pass_ms(3000);
    let arrived = TickStamp { tick_ms: bench.tick_ms, us: 345 };
    for byte in FrameEncoder::new(Command::Time { token: 77 }.to_body()) {
        bench.node.serial_receive(byte, arrived);
    }
    // The reply waits for its turn, and meanwhile the clock is set.
    bench.pass_ms(500);
    bench.send(FrameEncoder::new(Command::SetClock(TEN_O_CLOCK).to_body()));
    let replies = bench::replies(&bench.line());
    let [Reply::Time(reading), Reply::ClockSet] = replies[..] else { panic!("{replies:?}") };
    assert_eq!((reading.token, reading.clock_us), (77, TEN_O_CLOCK_US + 3_000_345));
    assert_eq!(reading.tick_us, u64::from(arrived.tick_ms) * 1000 + 345);
}

/// Whatever happens while the reply waits is behind the moment that the reply is about.
#[test]
fn all_of_a_reading_is_as_of_the_arrival_of_the_question() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(3);
    bench.pass_ms(1000);
    let question = |token| FrameEncoder::new(Command::Time { token }.to_body());
    bench.send(question(1));
    bench.events(7);
    bench.pass_ms(2000);
    bench.send(FrameEncoder::new(Command::SetClock(TEN_O_CLOCK).to_body()));
    bench.send(question(2));
    bench.send(FrameEncoder::new(Command::Erase.to_body()));
    bench.events(2);
    bench.send(question(3));
    let replies = bench::replies(&bench.line());
    let [
        Reply::Time(first),
        Reply::ClockSet,
        Reply::Time(second),
        Reply::Erased,
        Reply::Time(third),
    ] = replies[..]
    else {
        panic!("{replies:?}")
    };
    let told = |of: ClockReading| (of.token, of.source, of.age_s, of.life, of.next_sequence);
    assert_eq!(told(first), (1, ClockSource::NeverSet, 1, 1, 4));
    assert_eq!(told(second), (2, ClockSource::HostOverRs232, 0, 1, 11));
    // The erase is done before this reply, and its two events are still the old life's.
    assert_eq!(told(third), (3, ClockSource::HostOverRs232, 0, 1, 13));
}

#[test]
fn a_reading_tells_where_the_time_is_from_and_where_the_log_stands() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(3);
    bench.pass_ms(5000);
    let never = reading(&mut bench, 1);
    assert_eq!((never.source, never.age_s, never.doubt_us), (ClockSource::NeverSet, 5, None));
    assert_eq!((never.life, never.next_sequence, never.last_mark), (1, 4, None));
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.ask(&Command::Erase);
    bench.pass_ms(2500);
    let set = reading(&mut bench, 2);
    assert_eq!((set.source, set.age_s), (ClockSource::HostOverRs232, 2));
    assert_eq!((set.life, set.next_sequence), (2, 1));
    assert_eq!((set.drift_ppb, set.clock_us), (None, TEN_O_CLOCK_US + 2_500_000));

    let survivors = Survivors::default();
    *survivors.clock.borrow_mut() = Some("2026-11-22T10:00:00".parse().unwrap());
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 16, survivors);
    assert_eq!(reading(&mut bench, 3).source, ClockSource::Battery);
}

// F: filters

#[test]
fn filters_are_set_one_by_one_or_all_at_once_and_outlive_the_power() {
    let survivors = Survivors::default();
    let power_up = |model| Bench::with(model, Debounce::uniform(7), 16, survivors.clone());
    let mut bench = power_up(Model::Ser160);
    let strapped = InputFilter { debounce_ms: 7, chatter: None };
    let first = input(1);
    let page = filters(&mut bench, &Command::QueryFilters { first });
    assert_eq!((page.first, &page.filters[..]), (first, &[strapped; 16][..]), "the board decides");

    let one = InputFilter { debounce_ms: 0, chatter: chatter(5, 1000, 2000) };
    let page = filters(&mut bench, &Command::SetFilter { input: Some(input(3)), filter: one });
    assert_eq!((page.first, page.filters.len()), (input(3), 14));
    assert_eq!((page.filters[0], page.filters[1]), (one, strapped));
    let mut bench = power_up(Model::Ser160);
    let page = filters(&mut bench, &Command::QueryFilters { first: input(2) });
    assert_eq!(page.filters[..3], [strapped, one, strapped]);

    let all = InputFilter { debounce_ms: 250, chatter: None };
    filters(&mut bench, &Command::SetFilter { input: None, filter: all });
    bench.configure_with(Configure { size: Some(9), ..Configuration::default().into() });
    let mut bench = power_up(Model::Ser160);
    let page = filters(&mut bench, &Command::QueryFilters { first });
    assert_eq!(page.filters[..], [all; 16]);
}

#[test]
fn a_filter_of_an_input_that_there_is_not_is_refused_and_nothing_changes() {
    let mut bench = Bench::new(Model::Ser160);
    let filter = InputFilter { debounce_ms: 5, chatter: None };
    let page = filters(&mut bench, &Command::SetFilter { input: Some(input(17)), filter });
    assert_eq!((page.first, page.filters.len()), (input(17), 0));
    assert_eq!(bench.diagnostics().parameters_refused, 1);
    let page = filters(&mut bench, &Command::QueryFilters { first: input(16) });
    assert_eq!(page.filters[..], [InputFilter::OFF]);
}

#[test]
fn a_debounce_time_that_a_host_sets_holds_from_the_next_change_on() {
    let mut bench = Bench::new(Model::Ser160);
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    let filter = InputFilter { debounce_ms: 5, chatter: None };
    filters(&mut bench, &Command::SetFilter { input: Some(input(1)), filter });
    bench.pass_ms(9);
    bench.contacts(0b11);
    bench.contacts(0b10);
    bench.pass_ms(8);
    bench.contacts(0b11);
    bench.pass_ms(20);
    let first_seen = |time: &str| format!("2026-11-22T10:00:00.{time}");
    assert_eq!(
        changes(&bench.read(1, 10)),
        [(0b10, 0b10, first_seen("010")), (0b01, 0b11, first_seen("020"))],
        "input 1 bounced once, and its entry has the moment at which it began to stay"
    );
}

#[test]
fn what_chatters_is_left_out_and_counted_and_what_does_not_is_all_there() {
    let mut bench = Bench::new(Model::Ser160);
    let filter = InputFilter { debounce_ms: 0, chatter: chatter(5, 1000, 1000) };
    filters(&mut bench, &Command::SetFilter { input: Some(input(1)), filter });
    for second in 0..60_u32 {
        for _ in 0..50 {
            bench.contacts(bench.inputs ^ 1);
            bench.pass_ms(9);
        }
        bench.contacts(bench.inputs ^ 1 << (1 + second % 15));
        bench.pass_ms(499);
    }
    bench.pass_ms(2000);
    // Four changes of input 1, and all of the others.
    assert_eq!(bench.read(1, 1).total, 4 + 60);
    let suppressed = |bench: &mut Bench, input| {
        let counter = Counter::suppressed(input).unwrap();
        counters(bench).into_iter().find(|(known, _)| *known == counter).unwrap().1
    };
    assert_eq!((suppressed(&mut bench, 1), suppressed(&mut bench, 2)), (60 * 50 - 4, 0));
    // It came to rest as it was recorded last, and is believed again.
    bench.contacts(bench.inputs ^ 1);
    assert_eq!(bench.read(1, 1).total, 65);
}

// D: diagnostics

#[test]
fn every_counter_can_be_asked_for() {
    let mut bench = Bench::new(Model::Ser320);
    bench.ask(&Command::Read { start: 0, count: 1 });
    bench.send(*b"\x1B0158580x");
    let all = counters(&mut bench);
    let value = |counter| all.iter().find(|(known, _)| *known == counter).map(|found| found.1);
    assert_eq!(value(Counter::PARAMETERS_REFUSED), Some(1));
    assert_eq!(value(Counter::STORAGE_ERRORS), Some(0));
    assert_eq!(value(Counter::suppressed(32).unwrap()), Some(0));
    assert_eq!(value(Counter::BROADCASTS), None, "there is no Genius port");
    assert_eq!(all.len(), 16 + 32);
}
