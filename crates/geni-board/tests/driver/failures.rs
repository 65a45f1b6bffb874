//! Heartbeat, faults, and the fate of work in progress.

use geni_board::{
    CommandError, Completion, Configuration, Data, Destination, Event, Failure, Options, Start,
    Transmission, TransmitError, TransmitPriority,
};

use crate::world::{World, configuration};

fn is_ready(event: &Event) -> bool {
    matches!(event, Event::Ready(_))
}

fn is_failed(event: &Event) -> bool {
    matches!(event, Event::Failed(_))
}

fn transmission(completion: Completion) -> Transmission {
    Transmission {
        destination: Destination::Device(30),
        function: 0x40,
        subfunction: 0x50,
        priority: TransmitPriority::Normal,
        completion,
        data: Data::from_slice(&[1, 2]).expect("short"),
    }
}

#[test]
fn a_healthy_board_stays_healthy() {
    let mut world = World::ready(configuration(4, 0, 16));
    for minute in 0..10_u8 {
        world.driver.set_global_data(&[minute; 4]).expect("four bytes");
        assert!(world.run(60_000).is_empty());
    }
    assert_eq!(world.driver.counters(), geni_board::Counters::default());
}

/// The accesses that an idle board costs on a slow external bus: the flag and the summary in every
/// poll, and the rest from time to time.
#[test]
fn idle_polls_are_cheap() {
    let mut world = World::ready(configuration(4, 0, 16));
    world.board().accesses = 0;
    world.run(10_000);
    let accesses = world.board().accesses;
    assert!(accesses < 10_000 * 3, "{accesses} accesses in 10000 polls");
}

#[test]
fn a_board_without_heartbeat_is_reset_and_comes_back() {
    let mut world = World::ready(configuration(2, 0, 16));
    world.driver.set_global_data(&[7, 8]).expect("two bytes");
    world.run(20);
    world.board().misbehaviour.no_heartbeat = true;
    let (failed_ms, events) = world.until(2_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::NoHeartbeat)]);
    assert!((800..1_300).contains(&failed_ms), "noticed after {failed_ms} ms");
    assert!(!world.driver.is_ready());
    assert_eq!(
        world.driver.transmit(transmission(Completion::Taken)),
        Err(TransmitError::NotReady)
    );

    world.board().misbehaviour.no_heartbeat = false;
    world.until(5_000, is_ready);
    world.run(20);
    assert_eq!(world.board().resets, 1);
    // Configuration and global data are restored without a request.
    assert_eq!(world.driver.configuration(), configuration(2, 0, 16));
    assert_eq!(world.board().ram[0x1F80..0x1F82], [7, 8]);
}

#[test]
fn a_host_that_was_away_does_not_blame_the_board() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.pace_ms = 30_000;
    assert!(world.run(300_000).is_empty());
    assert_eq!(world.driver.counters().failures, 0);
}

#[test]
fn a_board_with_hardware_faults_is_reset_at_once() {
    let mut world = World::ready(Configuration::DEFAULT);
    {
        let mut board = world.board();
        board.ram[0x0894] = 0x10;
        board.misbehaviour.hangs = true;
        board.flag(2);
    }
    let (failed_ms, events) = world.until(2_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::Hardware { faults: 0x10 })]);
    assert!(failed_ms < 10, "noticed after {failed_ms} ms");
    world.board().misbehaviour.hangs = false;
    world.until(5_000, is_ready);
}

#[test]
fn a_board_that_restarts_by_itself_is_found_out() {
    let mut world = World::ready(configuration(2, 0, 16));
    world.board().restart();
    let (_, events) = world.until(1_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::Restarted)]);
    world.until(5_000, is_ready);
    assert_eq!(world.driver.configuration(), configuration(2, 0, 16));
}

#[test]
fn a_restart_in_the_middle_of_a_command_is_not_taken_for_its_end() {
    for completion in
        [Completion::Taken, Completion::Acknowledged, Completion::Reply { subfunction: 1 }]
    {
        let mut world = World::ready(configuration(2, 0, 16));
        world.board().misbehaviour.command_ms = Some(500);
        world.driver.transmit(transmission(completion)).expect("accepted");
        world.run(50);
        world.board().restart();
        let (_, events) = world.until(1_000, is_failed);
        assert_eq!(events, [Event::Failed(Failure::Restarted)]);
        let lost = world.step().expect("the datagram is reported");
        match completion {
            Completion::Reply { .. } => {
                assert_eq!(lost, Event::Replied(Err(CommandError::BoardFailed)));
            }
            _ => assert_eq!(lost, Event::Sent(Err(CommandError::BoardFailed))),
        }
        world.board().misbehaviour.command_ms = None;
        world.until(5_000, is_ready);
        assert!(world.driver.can_transmit());
    }
}

#[test]
fn without_a_reset_line_a_failed_board_is_waited_for() {
    let options = Options {
        start: Start::Running,
        reset_line: false,
        ..Options::new(configuration(2, 0, 16))
    };
    let mut world = World::ready_with(options);
    world.board().misbehaviour.hangs = true;
    world.until(2_000, is_failed);
    let (_, events) = world.until(10_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::NoHeartbeat)]);
    world.board().misbehaviour.hangs = false;
    world.until(20_000, is_ready);
    assert_eq!(world.board().resets, 0);
    assert_eq!(world.driver.counters().resets, 0);
}

#[test]
fn a_datagram_that_still_waited_is_reported_too() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().misbehaviour.stalls = true;
    world.board().receive(30, 1, &[1]);
    world.run(5);
    world.driver.transmit(transmission(Completion::Acknowledged)).expect("accepted");
    let (_, events) = world.until(6_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::CommandStuck)]);
    assert_eq!(world.step(), Some(Event::Sent(Err(CommandError::BoardFailed))));
}
