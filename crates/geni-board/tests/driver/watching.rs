//! Chapters 5, 6 and 7: status, interrupts, devices.

use geni_board::{
    BlockKind, Configuration, Device, DeviceChange, Event, Interrupts, Options, Start, Status,
    TableError,
};

use crate::world::{World, configuration};

fn status_change(events: &[Event]) -> Option<Status> {
    events.iter().find_map(|event| match event {
        Event::StatusChanged(status) => Some(*status),
        _ => None,
    })
}

#[test]
fn devices_come_change_and_go() {
    let mut world = World::ready(configuration(0, 0, 16));
    world.board().device(12, [64, 1, 1, 0x34, 0x12, 8, 4, 3]);
    let device = Device {
        model: 64,
        outputs_disabled: true,
        reference: 0x1234,
        input_len: 8,
        output_len: 4,
        kind: BlockKind::Combination,
    };
    assert_eq!(
        world.run(20),
        [Event::Device { number: 12, change: DeviceChange::LoggedIn(device) }]
    );
    assert_eq!(world.driver.device(12), Ok(device));
    // The host itself changed the outputs flag.
    world.board().device(12, [64, 0, 1, 0x34, 0x12, 8, 4, 3]);
    assert_eq!(world.run(20), []);
    world.board().device(12, [64, 0, 1, 0x34, 0x12, 6, 4, 3]);
    let changed = Device { input_len: 6, outputs_disabled: false, ..device };
    assert_eq!(
        world.run(20),
        [Event::Device { number: 12, change: DeviceChange::Changed(changed) }]
    );
    world.board().device(12, [64, 0, 0, 0x34, 0x12, 6, 4, 3]);
    assert_eq!(world.run(20), [Event::Device { number: 12, change: DeviceChange::LoggedOut }]);
    assert_eq!(world.driver.device(12), Err(TableError::NotPresent));
}

#[test]
fn all_devices_at_once_are_all_reported() {
    let mut world = World::ready(configuration(0, 0, 16));
    for number in 0..32 {
        world.board().device(number, [1, 0, 1, 0, 0, 1, 1, 3]);
    }
    let mut numbers: Vec<u8> = world
        .run(100)
        .into_iter()
        .map(|event| match event {
            Event::Device { number, change: DeviceChange::LoggedIn(_) } => number,
            other => panic!("{other:?}"),
        })
        .collect();
    numbers.sort_unstable();
    // Address 7 is the board's own.
    assert_eq!(numbers, (0..32).filter(|&number| number != 7).collect::<Vec<_>>());
}

#[test]
fn a_device_that_is_longer_than_the_buffers_is_not_believed() {
    let mut world = World::ready(configuration(0, 0, 16));
    world.board().device(3, [1, 0, 1, 0, 0, 17, 1, 3]);
    assert_eq!(world.run(20), []);
    assert!(world.driver.counters().device_records_refused > 0);
    assert_eq!(world.driver.device(3), Err(TableError::NotPresent));
}

#[test]
fn leaving_and_joining_the_bus_is_told() {
    let mut world = World::ready(Configuration::DEFAULT);
    assert!(world.driver.status().is_some_and(|status| status.on_bus()));
    world.board().ram[0x0898..0x089A].copy_from_slice(&[0xFF, 0xFF]);
    let status = status_change(&world.run(300)).expect("left");
    assert!(!status.on_bus());
    assert_eq!(world.driver.counters().bus_losses, 1);
    world.board().ram[0x0898..0x089A].copy_from_slice(&[20, 0]);
    let status = status_change(&world.run(300)).expect("joined");
    assert_eq!(status.scan_ms, Some(20));
}

#[test]
fn bus_errors_are_counted_across_the_wrap() {
    let mut world = World::ready(Configuration::DEFAULT);
    for total in [0xFFF0_u16, 0x0010, 0x0010] {
        world.board().ram[0x0896..0x0898].copy_from_slice(&total.to_le_bytes());
        world.run(500);
    }
    assert_eq!(world.driver.counters().bus_errors, 0x1_0010);
}

#[test]
fn excessive_errors_and_the_monitor_are_told() {
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().ram[0x0895] = 0x04;
    world.board().flag(2);
    let status = status_change(&world.run(5)).expect("errors");
    assert!(status.excessive_errors && !status.monitor);
    world.board().ram[0x0895] = 0x01;
    let status = status_change(&world.run(300)).expect("monitor");
    assert!(!status.excessive_errors && status.monitor);
}

#[test]
fn flags_are_cleared_after_service() {
    let mut world = World::ready(Configuration::DEFAULT);
    for index in 1..8 {
        world.board().flag(index);
    }
    world.run(3);
    assert!(world.board().ram[0x08A2..0x08AA].iter().all(|&byte| byte == 0));
}

#[test]
fn a_pulse_on_the_interrupt_line_makes_flags_count_at_once() {
    // No interrupt is enabled, so the summary stays clear.
    let options = Options {
        start: Start::Running,
        interrupts: Interrupts::NONE,
        ..Options::new(Configuration::DEFAULT)
    };
    let mut world = World::ready_with(options);
    assert_eq!(world.peek(0x08B2) & 1, 1);
    // Without a pulse the flag is found within the period.
    world.board().device(3, [1, 0, 1, 0, 0, 1, 1, 3]);
    assert_eq!(world.peek(0x08A2), 0);
    let (_, events) = world.until(40, |event| matches!(event, Event::Device { .. }));
    assert_eq!(events.len(), 1);
    // With a pulse it is found at once.
    world.run(1);
    world.board().flag(3);
    world.driver.interrupt(world.now_ms);
    world.step();
    assert_eq!(world.peek(0x08A5), 0);
}

#[test]
fn a_host_that_wants_to_keep_time_with_the_bus_can() {
    let options = Options {
        start: Start::Running,
        interrupts: Interrupts::ALL,
        ..Options::new(Configuration::DEFAULT)
    };
    let mut world = World::ready_with(options);
    world.board().flag(4);
    assert_eq!(world.run(2), [Event::OutputsSent]);
    // Other flags are not reported.
    let mut world = World::ready(Configuration::DEFAULT);
    world.board().flag(4);
    assert_eq!(world.run(50), []);
}
