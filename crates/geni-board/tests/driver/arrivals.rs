//! Arrival times of datagrams, by the board's flags and by its interrupt line, however long the
//! command block is busy.

use geni_board::{
    Completion, Configuration, Data, Destination, Event, Interrupts, Options, ReceivedDatagram,
    Start, Transmission, TransmitPriority,
};

use crate::world::World;

/// How long a command keeps the block busy.
fn busy(world: &mut World, for_ms: u32) {
    world.board().misbehaviour.command_ms = Some(for_ms);
    let transmission = Transmission {
        destination: Destination::Device(30),
        function: 0x40,
        subfunction: 0x50,
        priority: TransmitPriority::Normal,
        completion: Completion::Acknowledged,
        data: Data::from_slice(&[0x45]).expect("short"),
    };
    world.driver.transmit(transmission).expect("accepted");
    world.run(2);
}

/// The first byte of each datagram, and its arrival.
fn arrivals(events: &[Event]) -> Vec<(u8, Option<u32>)> {
    let received = |event: &Event| match event {
        Event::Received(ReceivedDatagram { data, arrived_ms, .. }) => Some((data[0], *arrived_ms)),
        _ => None,
    };
    events.iter().filter_map(received).collect()
}

/// A board whose interrupt line signals datagrams only.
fn with_line() -> World {
    World::ready_with(Options {
        start: Start::Running,
        interrupts: Interrupts::RECEIVE_QUEUE,
        ..Options::new(Configuration::DEFAULT)
    })
}

#[test]
fn a_datagram_that_comes_while_another_is_sent_arrived_when_its_flag_was_set() {
    let mut world = World::ready(Configuration::DEFAULT);
    busy(&mut world, 700);
    let mut expected = Vec::new();
    for number in 1..=3 {
        world.run(150);
        world.board().receive(30, 0, &[number]);
        expected.push((number, Some(world.now_ms + 1)));
    }
    world.step();
    assert_eq!(world.driver.oldest_arrival_ms(), expected[0].1);
    world.board().misbehaviour.command_ms = Some(100);
    let events = world.run(1_200);
    assert_eq!(arrivals(&events), expected);
    assert_eq!(world.driver.oldest_arrival_ms(), None);
}

#[test]
fn two_datagrams_between_two_looks_are_off_by_no_more_than_a_look() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.pace_ms = 7;
    world.board().receive(30, 1, &[1]);
    world.board().receive(29, 1, &[2]);
    let looked_ms = world.now_ms + 7;
    assert_eq!(arrivals(&world.run(100)), [(1, Some(looked_ms)), (2, Some(looked_ms))]);
}

#[test]
fn with_the_interrupt_line_a_host_that_was_away_knows_each_arrival() {
    let mut world = with_line();
    let began_ms = world.now_ms;
    for (number, after_ms) in [(1, 20), (2, 320), (3, 321)] {
        world.board().receive(30, 0, &[number]);
        world.driver.interrupt(began_ms + after_ms);
    }
    world.pace_ms = 400;
    world.step();
    world.pace_ms = 1;
    let expected = [20, 320, 321].map(|after_ms| Some(began_ms + after_ms));
    let seen: Vec<_> =
        arrivals(&world.run(100)).into_iter().map(|(_, arrived_ms)| arrived_ms).collect();
    assert_eq!(seen, expected);
}

#[test]
fn a_pulse_that_may_mean_anything_is_not_taken_for_a_datagram() {
    // All interrupts pull the line here.
    let mut world = World::ready(Configuration::DEFAULT);
    world.driver.interrupt(world.now_ms);
    world.board().receive(30, 1, &[1]);
    world.pace_ms = 5;
    let looked_ms = world.now_ms + 5;
    assert_eq!(arrivals(&world.run(50)), [(1, Some(looked_ms))]);
}

#[test]
fn a_datagram_whose_flag_was_lost_has_arrived_nobody_knows_when() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.no_flags = true;
    world.board().receive(30, 1, &[1]);
    assert_eq!(arrivals(&world.run(1_100)), [(1, None)]);
}

#[test]
fn a_datagram_that_makes_no_sense_leaves_the_next_one_its_flag() {
    let mut world = World::ready(Configuration::DEFAULT);
    // No such device exists.
    world.board().receive(40, 1, &[1]);
    world.step();
    world.board().receive(30, 1, &[2]);
    let expected_ms = world.now_ms + 1;
    assert_eq!(arrivals(&world.run(50)), [(2, Some(expected_ms))]);
    assert_eq!(world.driver.counters().datagrams_refused, 1);
}

#[test]
fn a_board_that_fails_takes_its_datagrams_and_their_arrivals_with_it() {
    let mut world = World::ready(Configuration::DEFAULT);
    busy(&mut world, 1_500);
    world.board().receive(30, 1, &[1]);
    world.run(2);
    assert!(world.driver.oldest_arrival_ms().is_some());
    world.board().misbehaviour.hangs = true;
    world.until(3_000, |event| matches!(event, Event::Failed(_)));
    assert_eq!(world.driver.oldest_arrival_ms(), None);
    world.board().misbehaviour = crate::board::Misbehaviour::default();
    world.until(10_000, |event| matches!(event, Event::Ready(_)));
    world.run(20);
    assert_eq!(world.driver.oldest_arrival_ms(), None);
    world.board().receive(30, 1, &[2]);
    let expected_ms = world.now_ms + 1;
    assert_eq!(arrivals(&world.run(50)), [(2, Some(expected_ms))]);
}

#[test]
fn what_comes_while_the_board_joins_the_bus_is_seen_to_arrive() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.driver.configure(crate::world::configuration(2, 0, 128));
    world.until(200, |event| matches!(event, Event::Configured(_)));
    world.run(100);
    world.board().receive(30, 1, &[1]);
    let expected_ms = world.now_ms + 1;
    let (_, events) = world.until(3_000, |event| matches!(event, Event::Received(_)));
    assert_eq!(arrivals(&events), [(1, Some(expected_ms))]);
}
