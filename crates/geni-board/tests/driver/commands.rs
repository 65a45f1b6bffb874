//! Chapter 10: Read Datagram, Transmit Datagram, Transmit Datagram with Reply.

use geni_board::{
    CommandError, Completion, Configuration, Data, Destination, Event, Failure, Options,
    ReceivedDatagram, Start, Transmission, TransmitError, TransmitPriority,
};

use crate::board::Board;
use crate::world::{World, configuration};

fn transmission(completion: Completion) -> Transmission {
    Transmission {
        destination: Destination::Device(30),
        function: 0x40,
        subfunction: 0x50,
        priority: TransmitPriority::Normal,
        completion,
        data: Data::from_slice(&[0x45]).expect("short"),
    }
}

fn is_end_of_transmission(event: &Event) -> bool {
    matches!(event, Event::Sent(_) | Event::Replied(_))
}

/// Sends a datagram to a board that ends commands with this status.
fn outcome(completion: Completion, status: Option<u8>) -> Event {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.command_status = status;
    world.board().reply = Some(vec![1, 2, 3]);
    world.driver.transmit(transmission(completion)).expect("accepted");
    assert!(!world.driver.can_transmit());
    let (_, mut events) = world.until(100, is_end_of_transmission);
    assert!(world.driver.can_transmit());
    assert_eq!(world.board().sent.len(), 1);
    events.pop().expect("the last one")
}

#[test]
fn a_datagram_is_sent_as_the_table_has_it() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    let (_, events) = world.until(100, is_end_of_transmission);
    assert_eq!(events, [Event::Sent(Ok(()))]);
    let sent = world.board().sent.pop().expect("sent");
    assert_eq!((&sent.block[1..7], &sent.data[..]), (&[2, 30, 0x40, 0x50, 0, 1][..], &[0x45][..]));
}

#[test]
fn every_status_has_its_meaning() {
    use CommandError::{Cleared, Failed, Refused, UnknownStatus};
    for (completion, status, expected) in [
        (Completion::Acknowledged, None, Ok(())),
        (Completion::Acknowledged, Some(0), Ok(())),
        (Completion::Acknowledged, Some(8), Err(Refused)),
        (Completion::Acknowledged, Some(0x10), Err(Failed)),
        (Completion::Acknowledged, Some(10), Err(UnknownStatus(10))),
        // The status is cleared at once, so nothing more is known.
        (Completion::Taken, Some(8), Ok(())),
    ] {
        assert_eq!(outcome(completion, status), Event::Sent(expected), "{completion:?} {status:?}");
    }
    let completion = Completion::Reply { subfunction: 0x51 };
    for (status, expected) in
        [(0, Cleared), (8, Refused), (0x10, Failed), (0x80, UnknownStatus(0x80))]
    {
        assert_eq!(outcome(completion, Some(status)), Event::Replied(Err(expected)), "{status:?}");
    }
}

#[test]
fn a_reply_comes_from_whom_it_was_asked() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().reply = Some(vec![9, 8, 7]);
    world.driver.transmit(transmission(Completion::Reply { subfunction: 0x51 })).expect("accepted");
    let (_, events) = world.until(100, is_end_of_transmission);
    let reply = ReceivedDatagram {
        source: 30,
        function: 0x40,
        subfunction: 0x51,
        broadcast: false,
        arrived_ms: None,
        data: Data::from_slice(&[9, 8, 7]).expect("short"),
    };
    assert_eq!(events, [Event::Replied(Ok(reply))]);
}

#[test]
fn the_board_gives_up_on_a_reply_before_the_driver_does() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.command_ms = Some(10_000);
    world.driver.transmit(transmission(Completion::Reply { subfunction: 0x51 })).expect("accepted");
    let (after_ms, events) = world.until(11_000, is_end_of_transmission);
    assert_eq!(events, [Event::Replied(Err(CommandError::Failed))]);
    assert!(after_ms >= 10_000);
    assert_eq!(world.driver.counters().commands_timed_out, 0);
}

#[test]
fn a_command_that_ends_late_is_not_taken_for_the_next_one() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.command_ms = Some(4_000);
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    let (after_ms, events) = world.until(3_000, is_end_of_transmission);
    assert_eq!(events, [Event::Sent(Err(CommandError::TimedOut))]);
    assert!((2_000..2_010).contains(&after_ms), "gave up after {after_ms} ms");

    // The next command must wait for the end of the first.
    let mut next = transmission(Completion::Acknowledged);
    next.data = Data::from_slice(&[0x4C]).expect("short");
    world.driver.transmit(next).expect("accepted");
    world.run(1_500);
    assert!(world.board().sent.is_empty());
    world.run(1_000);
    world.board().misbehaviour.command_ms = None;
    let (_, events) = world.until(3_000, is_end_of_transmission);
    assert_eq!(events, [Event::Sent(Ok(()))]);
    let board = world.board();
    assert_eq!(board.sent.iter().map(|sent| sent.data[0]).collect::<Vec<_>>(), [0x45, 0x4C]);
    let counters = world.driver.counters();
    assert_eq!((counters.commands_timed_out, counters.commands_late), (1, 1));
}

#[test]
fn a_command_that_never_ends_is_a_failed_board() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.stalls = true;
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    world.until(3_000, is_end_of_transmission);
    let (_, events) = world.until(6_000, |event| matches!(event, Event::Failed(_)));
    assert_eq!(events, [Event::Failed(Failure::CommandStuck)]);
    world.board().misbehaviour.stalls = false;
    world.until(5_000, |event| matches!(event, Event::Ready(_)));
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    world.until(100, is_end_of_transmission);
}

#[test]
fn the_receive_queue_is_drained_in_order() {
    let mut world = World::ready(Configuration::DEFAULT);
    for number in 0..15 {
        world.board().receive(30, 1, &[number]);
    }
    let events = world.run(200);
    let numbers: Vec<u8> = events
        .iter()
        .map(|event| match event {
            Event::Received(received) => received.data[0],
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(numbers, (0..15).collect::<Vec<_>>());
    assert!(world.board().receive_queue.is_empty());
}

#[test]
fn a_datagram_that_comes_late_is_not_lost() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.command_ms = Some(3_000);
    world.board().receive(30, 1, &[0x4D]);
    let (_, events) = world.until(4_000, |event| matches!(event, Event::Received(_)));
    assert_eq!(events.len(), 1);
}

#[test]
fn a_lost_flag_loses_no_datagram() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.no_flags = true;
    world.board().receive(30, 1, &[0x4D]);
    world.until(1_100, |event| matches!(event, Event::Received(_)));
}

#[test]
fn own_broadcasts_are_dropped_and_others_are_not() {
    let mut world = World::ready(Configuration::DEFAULT);
    // The board has bus address 7.
    world.board().receive(7, 0, &[1]);
    world.board().receive(8, 0, &[2]);
    world.board().receive(8, 2, &[3]);
    world.board().receive(8, 1, &[4]);
    world.board().receive(7, 1, &[5]);
    let received: Vec<(bool, u8)> = world
        .run(100)
        .into_iter()
        .filter_map(|event| match event {
            Event::Received(received) => Some((received.broadcast, received.data[0])),
            _ => None,
        })
        .collect();
    assert_eq!(received, [(true, 2), (true, 3), (false, 4), (false, 5)]);
    assert_eq!(world.driver.counters().own_broadcasts, 1);
}

#[test]
fn impossible_datagrams_are_counted_and_do_not_stop_the_queue() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().receive(200, 1, &[1]);
    world.board().receive(30, 1, &[2]);
    world.board().receive_queue[1].len = 255;
    world.board().receive(30, 1, &[3]);
    let events = world.run(100);
    assert_eq!(events.len(), 1, "{events:?}");
    assert_eq!(world.driver.counters().datagrams_refused, 2);
}

#[test]
fn reading_and_sending_take_turns() {
    let mut world = World::ready(Configuration::DEFAULT);
    for number in 0..14 {
        world.board().receive(30, 1, &[number]);
    }
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    let (_, events) = world.until(100, is_end_of_transmission);
    assert!(events.len() <= 3, "{events:?}");
}

#[test]
fn a_command_left_behind_by_somebody_else_is_waited_for() {
    let options = Options { start: Start::Running, ..Options::new(configuration(2, 0, 128)) };
    let mut board = Board::running(0);
    board.ram[0x08C2] = 1;
    board.ram[0x08C3] = 1;
    board.misbehaviour.command_ms = Some(1_000);
    let mut world = World::new(board, options);
    world.until(6_000, |event| matches!(event, Event::Ready(_)));
    let counters = world.driver.counters();
    assert_eq!((counters.commands_blocked, counters.failures), (1, 0));
}

#[test]
fn what_the_board_would_refuse_is_refused_at_once() {
    let mut world = World::ready(Configuration::DEFAULT);
    let good = transmission(Completion::Acknowledged);
    let reply = Completion::Reply { subfunction: 1 };
    for (bad, error) in [
        (
            Transmission { destination: Destination::Device(32), ..good.clone() },
            TransmitError::NoSuchDevice(32),
        ),
        (Transmission { function: 113, ..good.clone() }, TransmitError::FunctionCode(113)),
        (
            Transmission { destination: Destination::Broadcast, completion: reply, ..good.clone() },
            TransmitError::ReplyToBroadcast,
        ),
    ] {
        assert_eq!(world.driver.transmit(bad), Err(error));
    }
    let last = Transmission { destination: Destination::Device(31), function: 112, ..good.clone() };
    assert_eq!(world.driver.transmit(last), Ok(()));
    assert_eq!(world.driver.transmit(good), Err(TransmitError::Busy));
}

#[test]
fn the_status_byte_is_written_last() {
    for completion in
        [Completion::Taken, Completion::Acknowledged, Completion::Reply { subfunction: 0x51 }]
    {
        let mut world = World::ready(Configuration::DEFAULT);
        world.board().reply = Some(vec![1]);
        world.board().written.clear();
        world.driver.transmit(transmission(completion)).expect("accepted");
        world.until(100, is_end_of_transmission);
        let board = world.board();
        let written: Vec<_> =
            board.written.iter().filter(|at| (0x08C2..0x09C2).contains(*at)).collect();
        // The block and the buffer are written first, the status byte once and last.
        assert!(written.len() >= 7 && written.contains(&&0x08D2), "{written:X?}");
        assert_eq!(
            written.iter().position(|at| **at == 0x08C2),
            Some(written.len() - 1),
            "{written:X?}"
        );
    }
}

#[test]
fn a_read_that_fails_against_the_manual_is_tried_again_later() {
    let mut world = World::ready(Configuration::DEFAULT);
    let failed = world.driver.counters().commands_failed;
    world.board().misbehaviour.command_status = Some(0x10);
    world.board().flag(6);
    assert!(world.run(50).is_empty());
    // The driver does not read again, because nothing signals a datagram.
    assert_eq!(world.driver.counters().commands_failed, failed + 1);
    world.board().misbehaviour.command_status = None;
    world.board().receive(30, 1, &[0x4D]);
    world.until(100, |event| matches!(event, Event::Received(_)));
}

#[test]
fn the_host_is_told_when_the_receive_queue_is_empty() {
    let mut world = World::ready(Configuration::DEFAULT);
    assert!(world.driver.receive_queue_is_empty());
    // The board does not signal the datagram; the host asks.
    world.board().misbehaviour.no_flags = true;
    for number in 0..3 {
        world.board().receive(30, 1, &[number]);
    }
    world.driver.check_receive_queue();
    assert!(!world.driver.receive_queue_is_empty());
    let mut received = 0;
    while !world.driver.receive_queue_is_empty() {
        received +=
            world.step().into_iter().filter(|event| matches!(event, Event::Received(_))).count();
        assert!(world.now_ms < 5_000, "the queue is never empty");
    }
    assert_eq!(received, 3);
}

#[test]
fn what_arrives_while_the_queue_is_found_empty_is_read_at_once() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.command_ms = Some(50);
    world.driver.check_receive_queue();
    world.run(49);
    // The board has looked and is about to answer; its flag comes before the answer.
    world.board().receive(30, 1, &[7]);
    let (after_ms, _) = world.until(500, |event| matches!(event, Event::Received(_)));
    assert!(after_ms <= 110, "after {after_ms} ms");
}

#[test]
fn a_board_in_the_time_of_a_busy_computer_gets_longer_for_everything() {
    let options = Options {
        start: Start::Running,
        heartbeat_timeout_ms: 30_000,
        ..Options::new(configuration(4, 0, 128))
    };
    let mut world = World::ready_with(options);
    world.board().misbehaviour.command_ms = Some(29_000);
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    let (_, events) = world.until(30_000, is_end_of_transmission);
    assert_eq!(events, [Event::Sent(Ok(()))]);
    world.driver.transmit(transmission(Completion::Reply { subfunction: 0x51 })).expect("accepted");
    world.board().reply = Some(vec![1]);
    // The board may be looking into its receive queue before each of them.
    world.until(60_000, |event| matches!(event, Event::Replied(Ok(_))));
    world.board().receive(30, 1, &[7]);
    world.until(60_000, |event| matches!(event, Event::Received(_)));

    world.board().misbehaviour.command_ms = None;
    world.board().misbehaviour.ignores_lockout = true;
    world.run(100);
    world.driver.set_global_data(&[1, 2, 3, 4]).expect("four bytes");
    assert_eq!(world.run(29_000), []);
    let (_, events) = world.until(2_000, |event| matches!(event, Event::Failed(_)));
    assert_eq!(events, [Event::Failed(Failure::LockoutStuck)]);
}
