//! Chapter 13: the request queue.

use geni_board::{
    AnswerError, Configuration, Event, Options, READ_DEVICE, RequestAnswer, RequestHeader,
    RequestStatus, Requests, Start, WRITE_DEVICE, WRITE_POINT,
};

use crate::world::World;

fn asking() -> World {
    let options = Options {
        start: Start::Running,
        requests: Requests::Ask,
        ..Options::new(Configuration::DEFAULT)
    };
    World::ready_with(options)
}

/// Device 30 reads three bytes from 001234h.
const READ: [u8; 8] = [READ_DEVICE, 0, 3, 0x34, 0x12, 0, 30, 0];
/// Device 30 writes two bytes to 001234h.
const WRITE: [u8; 10] = [WRITE_DEVICE, 0, 2, 0x34, 0x12, 0, 30, 0, 0xAA, 0xBB];

fn is_request(event: &Event) -> bool {
    matches!(event, Event::Request(_))
}

#[test]
fn memory_access_is_refused_with_the_syntax_status() {
    let mut world = World::ready(Configuration::DEFAULT);
    assert!(world.board().request(&READ));
    let (_, events) = world.until(10, |event| matches!(event, Event::RequestRefused(_)));
    let header =
        RequestHeader { command: 0x1E, len: 3, address: 0x1234, source: 30, auxiliary_source: 0 };
    assert_eq!(events, [Event::RequestRefused(header)]);
    let board = world.board();
    assert_eq!((board.ram[1], board.ram[0x0880], board.ram[0x0881]), (4, 1, 1));
    assert_eq!(world.driver.counters().requests_refused, 1);
}

#[test]
fn a_full_queue_is_emptied_and_noticed_and_goes_around() {
    let mut world = World::ready(Configuration::DEFAULT);
    for round in 1..=3 {
        while world.board().request(&WRITE) {}
        assert_eq!(world.run(100).len(), 15);
        assert_eq!(world.driver.counters().requests_refused, round * 15);
        assert_eq!(world.driver.counters().request_queue_full, round);
    }
    let board = world.board();
    assert_eq!((board.ram[0x0880], board.ram[0x0881]), (45 % 16, 45 % 16));
}

#[test]
fn a_write_point_brings_its_masks() {
    let mut world = asking();
    world.board().request(&[WRITE_POINT, 0, 4, 0x34, 0x12, 0, 30, 0, 0xFE, 0x01, 0xFF, 0x00]);
    let (_, events) = world.until(10, is_request);
    let Some(Event::Request(request)) = events.last() else { panic!("{events:?}") };
    assert_eq!((request.header.command, request.header.address), (0x0B, 0x1234));
    assert_eq!(request.data, [0xFE, 0x01, 0xFF, 0x00]);
    world.driver.answer_request(RequestAnswer::Status(RequestStatus::Complete)).expect("done");
    assert_eq!((world.peek(1), world.peek(0x0880)), (1, 1));
}

#[test]
fn a_host_with_memory_can_answer() {
    let mut world = asking();
    world.board().request(&READ);
    world.board().request(&WRITE);
    let (_, events) = world.until(10, is_request);
    let Some(Event::Request(request)) = events.last() else { panic!("{events:?}") };
    assert_eq!((request.header.command, request.header.address), (READ_DEVICE, 0x1234));
    let wrong = world.driver.answer_request(RequestAnswer::Data(&[1, 2]));
    assert_eq!(wrong, Err(AnswerError::WrongLength { expected: 3 }));
    world.driver.answer_request(RequestAnswer::Data(&[1, 2, 3])).expect("three bytes");
    assert_eq!(world.board().ram[..11], [0x1E, 1, 3, 0x34, 0x12, 0, 30, 0, 1, 2, 3]);
    assert_eq!(world.peek(0x0880), 1);

    let (_, events) = world.until(10, is_request);
    let Some(Event::Request(request)) = events.last() else { panic!("{events:?}") };
    assert_eq!(request.data, [0xAA, 0xBB]);
    world.driver.answer_request(RequestAnswer::Status(RequestStatus::Complete)).expect("done");
    assert_eq!((world.peek(137), world.peek(0x0880)), (1, 2));
    assert_eq!(
        world.driver.answer_request(RequestAnswer::Status(RequestStatus::Complete)),
        Err(AnswerError::NoRequest)
    );
}

#[test]
fn a_busy_host_gets_the_request_again() {
    let mut world = asking();
    world.board().request(&WRITE);
    world.until(10, is_request);
    world.driver.answer_request(RequestAnswer::Status(RequestStatus::Busy)).expect("taken");
    assert_eq!((world.peek(1), world.peek(0x0880)), (2, 1));
    // The board puts it at the end of the queue.
    world.board().request(&WRITE);
    world.until(10, is_request);
}

#[test]
fn a_host_that_does_not_answer_does_not_stop_the_queue() {
    let mut world = asking();
    world.board().request(&READ);
    world.board().request(&WRITE);
    world.until(10, is_request);
    let (after_ms, _) = world.until(2_100, |event| matches!(event, Event::RequestRefused(_)));
    assert!(after_ms >= 1_990, "refused after {after_ms} ms");
    assert_eq!(world.peek(1), 4);
    world.until(10, is_request);
    let counters = world.driver.counters();
    assert_eq!((counters.requests_unanswered, counters.requests_refused), (1, 1));
}

#[test]
fn an_answer_to_a_request_of_a_former_life_goes_nowhere() {
    let mut world = asking();
    world.board().request(&READ);
    world.until(10, is_request);
    world.board().restart();
    assert_eq!(
        world.driver.answer_request(RequestAnswer::Data(&[1, 2, 3])),
        Err(AnswerError::NoRequest)
    );
    assert_eq!(world.peek(0x0880), 0);
}

#[test]
fn nobody_refuses_a_request_of_a_former_life() {
    let mut world = asking();
    world.board().request(&READ);
    world.until(10, is_request);
    world.board().restart();
    let events = world.run(2_100);
    assert!(!events.iter().any(|event| matches!(event, Event::RequestRefused(_))), "{events:?}");
    assert_eq!(world.peek(0x0880), 0);
    let counters = world.driver.counters();
    assert_eq!((counters.requests_unanswered, counters.requests_refused), (1, 0));
}

#[test]
fn an_impossible_length_is_refused() {
    let mut world = asking();
    world.board().request(&[READ_DEVICE, 0, 129, 0, 0, 0, 30, 0]);
    world.until(10, |event| matches!(event, Event::RequestRefused(_)));
    assert_eq!(world.driver.counters().requests_malformed, 1);
}

#[test]
fn a_tail_out_of_range_is_not_followed() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().ram[0x0881] = 200;
    world.board().flag(1);
    assert!(world.run(500).is_empty());
    assert_eq!(world.peek(0x0880), 0);
    assert!(world.driver.counters().request_pointers_refused > 0);
}

#[test]
fn a_lost_flag_leaves_no_request_behind() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.no_flags = true;
    world.board().request(&WRITE);
    world.until(1_100, |event| matches!(event, Event::RequestRefused(_)));
}

#[test]
fn data_and_status_are_written_before_the_head_and_the_head_once() {
    let mut world = asking();
    while world.board().request(&READ) {}
    for index in 0..15 {
        world.until(10, is_request);
        world.board().written.clear();
        world.driver.answer_request(RequestAnswer::Data(&[1, 2, 3])).expect("three bytes");
        let at = index * 136;
        assert_eq!(world.board().written, [at + 8, at + 9, at + 10, at + 1, 0x0880]);
    }
}
