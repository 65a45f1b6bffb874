//! Chapter 3, Startup; chapter 4; chapter 10, Configuration Change.

use geni_board::{
    BoardSwitches, Configuration, ConfigurationOutcome, Event, Failure, Identity, Options,
    RateSetting, Start,
};

use crate::board::{Board, OK};
use crate::world::{World, configuration};

fn is_ready(event: &Event) -> bool {
    matches!(event, Event::Ready(_))
}

fn is_failed(event: &Event) -> bool {
    matches!(event, Event::Failed(_))
}

#[test]
fn reset_self_test_configuration_and_bus_follow_each_other() {
    let wanted = configuration(4, 0, 16);
    let mut world = World::new(Board::new(), Options::new(wanted));
    assert!(world.driver.reset_held());
    world.driver.set_global_data(&[1, 2, 3, 4]).expect("four bytes");

    let (_, events) = world.until(10_000, |event| matches!(event, Event::Configured(_)));
    assert_eq!(events, [Event::Configured(ConfigurationOutcome::Changed)]);
    {
        let board = world.board();
        assert!(board.released_ms >= 2_000, "reset line held {} ms", board.released_ms);
        let first_access_ms = board.first_access_ms.expect("there was one") - board.released_ms;
        assert!(
            (1_700..1_750).contains(&first_access_ms),
            "first access after {first_access_ms} ms"
        );
        assert_eq!(board.ram[0x0882..0x0888], [0xE7, 0xFF, 0xFF, 4, 0, 16]);
        // Only the interrupt in every scan is disabled.
        assert_eq!(board.ram[0x08B2..0x08BA], [0, 0, 0, 0, 1, 0, 0, 0]);
    }
    assert!(!world.driver.is_ready());
    let (off_bus_ms, events) = world.until(2_000, is_ready);
    assert!((1_495..1_510).contains(&off_bus_ms), "ready after {off_bus_ms} ms");
    let switches = BoardSwitches {
        device_number: 7,
        rate: RateSetting::K153_6Standard,
        outputs_enabled: true,
    };
    assert_eq!(
        events,
        [Event::Ready(Identity { revision: 0x21, switches, configuration: wanted })]
    );
    assert_eq!(world.driver.configuration(), wanted);
    assert_eq!(world.board().resets, 0, "one reset only, the first");
}

#[test]
fn the_first_global_data_on_the_bus_are_the_hosts() {
    let mut world = World::new(Board::new(), Options::new(configuration(2, 0, 128)));
    world.driver.set_global_data(&[0x12, 0x34]).expect("two bytes");
    while !world.board().on_bus {
        world.step();
        assert!(world.now_ms < 10_000);
    }
    assert_eq!(world.board().ram[0x1F80..0x1F82], [0x12, 0x34]);
}

#[test]
fn global_data_that_the_board_forgets_while_it_joins_are_given_again() {
    let mut board = Board::new();
    board.misbehaviour.forgets_global_data = true;
    let mut world = World::new(board, Options::new(configuration(2, 0, 128)));
    world.driver.set_global_data(&[0x12, 0x34]).expect("two bytes");
    world.until(10_000, is_ready);
    world.run(20);
    assert_eq!(world.board().ram[0x1F80..0x1F82], [0x12, 0x34]);
}

#[test]
fn a_configuration_that_is_in_force_already_costs_nothing() {
    let mut world = World::new(Board::new(), Options::new(Configuration::DEFAULT));
    let (_, events) = world.until(10_000, is_ready);
    assert_eq!(events[0], Event::Configured(ConfigurationOutcome::Unchanged));
    assert_eq!(world.board().configurations, 0);
    // The driver still waits for the 1.5 s after the OK flag.
    assert!(world.now_ms >= 2_000 + 1_700 + 1_500);
}

#[test]
fn a_board_that_is_running_is_not_disturbed() {
    let options = Options { start: Start::Running, ..Options::new(Configuration::DEFAULT) };
    let mut world = World::new(Board::running(0), options);
    let (ready_ms, events) = world.until(10_000, is_ready);
    assert_eq!(events[0], Event::Configured(ConfigurationOutcome::Unchanged));
    assert!(ready_ms < 300, "ready after {ready_ms} ms");
    let board = world.board();
    assert_eq!((board.resets, board.configurations, board.on_bus), (0, 0, true));
}

#[test]
fn a_flag_left_behind_by_a_dead_board_is_not_believed() {
    let options = Options {
        start: Start::Running,
        reset_line: false,
        ..Options::new(Configuration::DEFAULT)
    };
    let mut board = Board::running(0);
    board.misbehaviour.hangs = true;
    let mut world = World::new(board, options);
    let (failed_ms, events) = world.until(10_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::NoHeartbeat)]);
    assert!((1_000..1_100).contains(&failed_ms), "noticed after {failed_ms} ms");
}

/// What a window holds when there is no board, or one in its self-test.
fn silent_with(flag: u8) -> World {
    let options = Options {
        start: Start::Running,
        reset_line: false,
        ..Options::new(Configuration::DEFAULT)
    };
    let mut board = Board::running(0);
    board.misbehaviour.hangs = true;
    board.ram[OK] = flag;
    World::new(board, options)
}

#[test]
fn nothing_is_written_to_what_cannot_be_a_running_board() {
    for flag in [0x02, 0x20, 0x55, 0xFF] {
        let mut world = silent_with(flag);
        let (failed_ms, events) = world.until(10_000, is_failed);
        assert_eq!(events, [Event::Failed(Failure::NoHeartbeat)]);
        assert!((1_000..1_100).contains(&failed_ms), "noticed after {failed_ms} ms");
        // The driver does not write later either, when it tries again.
        world.run(10_000);
        assert_eq!(world.board().written, [], "{flag:02X}");
    }
}

#[test]
fn a_board_in_its_self_test_is_waited_for() {
    let mut world = silent_with(0x55);
    world.run(500);
    assert_eq!(world.board().written, []);
    world.board().ram[OK] = 1;
    world.board().misbehaviour.hangs = false;
    let (_, events) = world.until(10_000, is_ready);
    assert_eq!(events[0], Event::Configured(ConfigurationOutcome::Unchanged));
}

#[test]
fn a_released_board_is_left_alone_and_not_reset() {
    let options = Options { start: Start::Released, ..Options::new(Configuration::DEFAULT) };
    let mut world = World::new(Board::new(), options);
    assert!(!world.driver.reset_held());
    world.until(10_000, is_ready);
    assert_eq!(world.board().resets, 0);
}

#[test]
fn a_board_that_fails_its_self_test_is_reset_less_and_less_often() {
    let mut board = Board::new();
    board.misbehaviour.self_test_faults = 0x04;
    let mut world = World::new(board, Options::new(Configuration::DEFAULT));
    let mut gaps_ms = Vec::new();
    for _ in 0..12 {
        let (after_ms, events) = world.until(70_000, is_failed);
        assert_eq!(events, [Event::Failed(Failure::SelfTest { faults: 0x04 })]);
        gaps_ms.push(after_ms);
    }
    assert!(gaps_ms[1..].is_sorted(), "{gaps_ms:?}");
    assert!(gaps_ms[1] < 3_000 && gaps_ms[11] > 60_000, "{gaps_ms:?}");

    // The driver never gives up.
    world.board().misbehaviour.self_test_faults = 0;
    world.until(70_000, is_ready);
    let counters = world.driver.counters();
    assert_eq!((counters.failures, counters.resets), (12, 12));
}

#[test]
fn a_refused_configuration_tells_what_is_in_force() {
    let mut world = World::ready(configuration(2, 0, 16));
    world.board().misbehaviour.refuses_configuration = true;
    world.driver.configure(configuration(4, 0, 8));
    let (_, events) = world.until(100, is_ready);
    let refused = Event::Configured(ConfigurationOutcome::Refused(configuration(2, 0, 16)));
    assert!(events.contains(&refused), "{events:?}");
    assert_eq!(world.driver.configuration(), configuration(2, 0, 16));
    assert_eq!(world.driver.counters().configurations_refused, 1);
    // One request is enough.
    assert!(!world.run(5_000).iter().any(|event| matches!(event, Event::Configured(_))));
}

#[test]
fn a_configuration_without_an_answer_is_tried_three_times() {
    let mut board = Board::new();
    board.misbehaviour.command_status = Some(0x20);
    let mut world = World::new(board, Options::new(configuration(4, 0, 8)));
    let (_, events) = world.until(10_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::Configuration)]);
    assert_eq!(world.driver.counters().commands_unknown, 3);
    world.board().misbehaviour.command_status = None;
    world.until(10_000, is_ready);
}

#[test]
fn a_configuration_that_never_ends_is_a_failure() {
    let mut board = Board::new();
    board.misbehaviour.stalls = true;
    let mut world = World::new(board, Options::new(configuration(4, 0, 8)));
    let (_, events) = world.until(15_000, is_failed);
    assert_eq!(events, [Event::Failed(Failure::CommandStuck)]);
    world.board().misbehaviour.stalls = false;
    world.until(10_000, is_ready);
}

#[test]
fn changing_the_configuration_takes_the_board_off_the_bus_for_a_while() {
    let mut world = World::ready(configuration(2, 0, 128));
    let wanted = configuration(2, 8, 4);
    world.driver.configure(wanted);
    let (_, events) = world.until(100, |event| matches!(event, Event::Configured(_)));
    assert!(events.contains(&Event::Configured(ConfigurationOutcome::Changed)));
    assert!(!world.driver.can_transmit());
    let (ready_ms, _) = world.until(2_000, is_ready);
    assert!((1_495..1_510).contains(&ready_ms), "ready after {ready_ms} ms");
    assert_eq!(world.driver.configuration(), wanted);
    world.driver.configure(wanted);
    let (_, events) = world.until(100, is_ready);
    assert!(events.contains(&Event::Configured(ConfigurationOutcome::Unchanged)));
}

#[test]
fn a_host_that_looks_once_in_five_seconds_gets_there_too() {
    let mut world = World::new(Board::new(), Options::new(configuration(4, 0, 16)));
    world.pace_ms = 5_000;
    let (_, events) = world.until(100_000, is_ready);
    assert_eq!(events.len(), 2, "{events:?}");
    assert_eq!(world.driver.counters().failures, 0);
}

#[test]
fn the_clock_may_wrap_at_any_moment_of_the_start() {
    for before_wrap_ms in (0..6_000).step_by(97) {
        let mut world = World::new(Board::new(), Options::new(configuration(4, 0, 16)));
        world.now_ms = 0_u32.wrapping_sub(before_wrap_ms);
        let (ready_ms, events) = world.until(10_000, is_ready);
        assert_eq!(events.len(), 2, "{before_wrap_ms}: {events:?}");
        assert!(ready_ms < 5_500, "{before_wrap_ms}: {ready_ms}");
    }
}

#[test]
fn the_setup_table_is_written_before_the_command_that_makes_it_known() {
    let mut world = World::ready(configuration(2, 0, 128));
    world.board().written.clear();
    world.driver.configure(Configuration::new(0x1234, 4, 8, 16).expect("lengths in range"));
    world.until(100, |event| matches!(event, Event::Configured(_)));
    let board = world.board();
    let table = 0x0882..0x0892;
    let written: Vec<_> = board
        .written
        .iter()
        .copied()
        .filter(|at| table.contains(at) || *at == 0x08C2 || *at == 0x08C3)
        .collect();
    assert_eq!(written, [0x0883, 0x0884, 0x0885, 0x0886, 0x0887, 0x08C3, 0x08C2]);
}
