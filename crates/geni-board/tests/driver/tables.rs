//! Chapters 8, 9, 11 and 12: the data exchanged in every scan, and lockout. The scripted board
//! panics when the host touches tables without lockout, asks twice or withdraws a request.

use geni_board::{Configuration, Event, Failure, Options, Start, TableError};

use crate::board::{Board, LOCKOUT_REQUEST, LOCKOUT_STATE};
use crate::world::{World, configuration};

fn is_locked(event: &Event) -> bool {
    matches!(event, Event::TablesLocked)
}

/// A device with this many inputs and outputs.
fn record(inputs: u8, outputs: u8) -> [u8; 8] {
    [64, 0, 1, 0x34, 0x12, inputs, outputs, 3]
}

#[test]
fn global_data_are_changed_under_lockout() {
    let mut world = World::ready(configuration(4, 0, 128));
    world.driver.set_global_data(&[1, 2, 3, 4]).expect("four bytes");
    world.run(10);
    assert_eq!(world.board().ram[0x1F80..0x1F84], [1, 2, 3, 4]);
    assert_eq!(world.board().lockouts, 1);
    assert_eq!((world.peek(LOCKOUT_REQUEST), world.peek(LOCKOUT_STATE)), (0, 0));
    // Unchanged data are not written again.
    world.driver.set_global_data(&[1, 2, 3, 4]).expect("four bytes");
    world.run(10);
    assert_eq!(world.board().lockouts, 1);
    assert_eq!(world.driver.set_global_data(&[1]), Err(TableError::WrongLength { expected: 4 }));
}

#[test]
fn a_single_byte_of_global_data_needs_no_lockout() {
    let mut world = World::ready(configuration(1, 0, 128));
    world.driver.set_global_data(&[0x55]).expect("one byte");
    world.run(2);
    assert_eq!(world.peek(0x1F80), 0x55);
    assert_eq!(world.board().lockouts, 0);
}

#[test]
fn a_busy_host_leaves_the_board_a_scan_between_two_lockouts() {
    let mut world = World::ready(configuration(4, 0, 128));
    let mut free_ms = 0;
    let mut shortest_ms = u32::MAX;
    for count in 0..2_000_u32 {
        world.driver.set_global_data(&count.to_le_bytes()).expect("four bytes");
        world.step();
        let board = world.board();
        if board.ram[LOCKOUT_REQUEST] == 0 && board.ram[LOCKOUT_STATE] == 0 {
            free_ms += 1;
        } else {
            if free_ms > 0 && count > 100 {
                shortest_ms = shortest_ms.min(free_ms);
            }
            free_ms = 0;
        }
    }
    // The scan takes 5 ms.
    assert!((5..8).contains(&shortest_ms), "{shortest_ms} ms");
    assert!(world.board().lockouts > 150);
}

#[test]
fn tables_are_the_hosts_until_the_next_poll() {
    let mut world = World::ready(configuration(0, 3, 16));
    {
        let mut board = world.board();
        board.device(12, record(2, 4));
        board.ram[0x2000 + 12 * 16..][..2].copy_from_slice(&[0x11, 0x22]);
        board.ram[0x1F00..0x1F03].copy_from_slice(&[7, 8, 9]);
    }
    assert_eq!(world.driver.tables().err(), Some(TableError::NotLocked));
    world.driver.request_tables();
    world.until(20, is_locked);
    let mut tables = world.driver.tables().expect("locked");
    let mut bytes = [0; 16];
    assert_eq!(tables.inputs(12, &mut bytes), Ok(2));
    assert_eq!(bytes[..3], [0x11, 0x22, 0]);
    assert_eq!(tables.inputs(12, &mut bytes[..1]), Err(TableError::WrongLength { expected: 2 }));
    assert_eq!(tables.inputs(13, &mut bytes), Err(TableError::NotPresent));
    assert_eq!(tables.inputs(255, &mut bytes), Err(TableError::NotPresent));
    assert_eq!(tables.directed_inputs(&mut bytes), Ok(3));
    assert_eq!(bytes[..3], [7, 8, 9]);
    assert_eq!(tables.set_outputs(12, &[1, 2, 3, 4]), Ok(()));
    assert_eq!(tables.set_outputs(12, &[1, 2, 3]), Err(TableError::WrongLength { expected: 4 }));
    assert_eq!(tables.set_outputs(13, &[1]), Err(TableError::NotPresent));
    assert_eq!(world.board().ram[0x2000 + 32 * 16 + 12 * 16..][..4], [1, 2, 3, 4]);

    world.step();
    assert_eq!(world.driver.tables().err(), Some(TableError::NotLocked));
    world.run(5);
    assert!(!world.board().locked());
}

#[test]
fn single_bytes_need_no_lockout() {
    let mut world = World::ready(configuration(0, 0, 1));
    world.board().device(3, record(1, 1));
    world.board().device(4, record(0, 0));
    world.board().ram[0x2003] = 0x81;
    assert_eq!(world.driver.input_byte(3), Ok(0x81));
    assert_eq!(world.driver.set_output_byte(3, 0x42), Ok(()));
    assert_eq!(world.peek(0x2000 + 32 + 3), 0x42);
    assert_eq!(world.driver.input_byte(4), Err(TableError::WrongLength { expected: 0 }));
    assert_eq!(world.driver.input_byte(5), Err(TableError::NotPresent));
    assert_eq!(world.board().lockouts, 0);
}

#[test]
fn outputs_of_a_device_are_enabled_by_one_byte() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.driver.enable_outputs(12, false).expect("ready");
    assert_eq!(world.peek(0x1E00 + 12 * 8 + 1), 1);
    world.driver.enable_outputs(12, true).expect("ready");
    assert_eq!(world.peek(0x1E00 + 12 * 8 + 1), 0);
    assert_eq!(world.driver.enable_outputs(32, true), Err(TableError::NotPresent));
}

#[test]
fn a_request_that_is_not_granted_is_never_withdrawn() {
    let mut world = World::ready(configuration(4, 0, 128));
    world.board().misbehaviour.ignores_lockout = true;
    world.driver.set_global_data(&[1, 2, 3, 4]).expect("four bytes");
    world.run(4_000);
    assert_eq!((world.peek(LOCKOUT_REQUEST), world.peek(LOCKOUT_STATE)), (1, 0));
    // The lockout is granted late, which is fine.
    world.board().misbehaviour.ignores_lockout = false;
    world.run(10);
    assert_eq!(world.board().ram[0x1F80..0x1F84], [1, 2, 3, 4]);
    // The lockout is never granted, so the board has failed.
    world.board().misbehaviour.ignores_lockout = true;
    world.driver.set_global_data(&[1, 2, 3, 5]).expect("four bytes");
    let (_, events) = world.until(6_000, |event| matches!(event, Event::Failed(_)));
    assert_eq!(events, [Event::Failed(Failure::LockoutStuck)]);
    world.board().misbehaviour.ignores_lockout = false;
    world.until(5_000, |event| matches!(event, Event::Ready(_)));
    world.run(10);
    assert_eq!(world.board().ram[0x1F80..0x1F84], [1, 2, 3, 5]);
}

#[test]
fn lockout_left_behind_by_a_dead_host_is_ended() {
    for granted in [0, 1] {
        let options = Options { start: Start::Running, ..Options::new(Configuration::DEFAULT) };
        let mut board = Board::running(0);
        board.ram[LOCKOUT_REQUEST] = 1;
        board.ram[LOCKOUT_STATE] = granted;
        board.misbehaviour.ignores_lockout = granted == 0;
        let mut world = World::new(board, options);
        world.until(1_000, |event| matches!(event, Event::Ready(_)));
        world.run(20);
        world.board().misbehaviour.ignores_lockout = false;
        world.run(20);
        assert_eq!((world.peek(LOCKOUT_REQUEST), world.peek(LOCKOUT_STATE)), (0, 0));
        assert_eq!(world.driver.counters().lockouts_foreign, 1);
    }
}

#[test]
fn lockout_that_ends_by_itself_is_counted() {
    let mut world = World::ready(configuration(0, 0, 16));
    world.driver.request_tables();
    world.until(20, is_locked);
    world.board().ram[LOCKOUT_REQUEST] = 0;
    world.board().ram[LOCKOUT_STATE] = 0;
    world.run(10);
    assert_eq!(world.driver.counters().lockouts_lost, 1);
    world.driver.request_tables();
    world.until(20, is_locked);
}

#[test]
fn a_new_buffer_length_moves_the_output_table() {
    let mut world = World::ready(configuration(0, 0, 16));
    world.driver.configure(configuration(0, 0, 4));
    world.until(3_000, |event| matches!(event, Event::Ready(_)));
    world.board().device(2, record(2, 2));
    world.driver.request_tables();
    world.until(20, is_locked);
    world.driver.tables().expect("locked").set_outputs(2, &[5, 6]).expect("present");
    assert_eq!(world.board().ram[0x2000 + 32 * 4 + 2 * 4..][..2], [5, 6]);
}
