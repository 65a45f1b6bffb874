//! Chapter 5: the status table.

use super::rig::{Rig, SECOND_US};
use crate::genius::{
    BlockKind, BusInterfaceUnit, BusTiming, Circuits, DeviceFault, DiscreteBlock, Fault,
    StationData, ViolationKind,
};

#[test]
fn the_board_sets_the_ok_flag_every_200_ms_so_that_the_host_can_watch_it() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x0893, 0);
    rig.wait_for(host, 0x0893, 1);
    let first_us = rig.bus.now_us();
    rig.write(host, 0x0893, 0);
    rig.wait_for(host, 0x0893, 1);
    assert_eq!(rig.bus.now_us() - first_us, 200_000);
    rig.assert_lawful(&[host]);
}

#[test]
fn a_hanging_board_no_longer_sets_it() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.bus.inject(Fault::Inside { device: host.id(), fault: DeviceFault::Hang });
    rig.write(host, 0x0893, 0);
    rig.advance_ms(5_000);
    assert_eq!(rig.read(host, 0x0893), 0);
}

#[test]
fn a_hardware_fault_clears_the_ok_flag_interrupts_and_stops_the_board() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.inject(Fault::Inside { device: host.id(), fault: DeviceFault::FailSelfTest(0x01) });
    assert_eq!(rig.read_array(host, 0x0893), [0, 0x01]);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A4)), (1, 1));
    rig.wait_for(other, 0x1E02 + 8 * 30, 0);
}

#[test]
fn with_the_status_change_interrupt_disabled_the_ok_flag_just_stays_as_it_is() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.write_all(host, 0x08B2, &[0, 0, 1, 0, 1]);
    let pulses = rig.bus.get(host).interrupt_pulses();
    rig.bus.inject(Fault::Inside { device: host.id(), fault: DeviceFault::FailSelfTest(0x04) });
    assert_eq!(rig.read_array(host, 0x0893), [1, 0x04]);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A4)), (0, 1));
    assert_eq!(rig.bus.get(host).interrupt_pulses(), pulses);
    rig.write(host, 0x0893, 0);
    rig.advance_ms(1_000);
    assert_eq!(rig.read(host, 0x0893), 0);
}

#[test]
fn bus_errors_are_counted_and_the_count_wraps() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    assert_eq!(rig.read_word(host, 0x0896), 0);
    rig.bus.inject(Fault::Deafen { device: host.id(), messages: 3 });
    rig.advance_ms(100);
    assert_eq!(rig.read_word(host, 0x0896), 3);
    rig.bus.inject(Fault::Deafen { device: host.id(), messages: 65_533 });
    let wrapped =
        rig.bus.advance_until(300 * SECOND_US, |bus| bus.get(host).ram()[0x0896..0x0898] == [0, 0]);
    assert!(wrapped);
}

#[test]
fn ten_errors_in_ten_seconds_are_excessive() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    for _ in 0..9 {
        rig.bus.inject(Fault::Deafen { device: host.id(), messages: 1 });
        rig.advance_ms(1_000);
    }
    assert_eq!((rig.read_word(host, 0x0896), rig.read(host, 0x0895)), (9, 0));
    assert_eq!(rig.read(host, 0x08A4), 0);
    rig.bus.inject(Fault::Deafen { device: host.id(), messages: 1 });
    rig.advance_ms(10);
    assert_eq!((rig.read_word(host, 0x0896), rig.read(host, 0x0895)), (10, 0x04));
    assert_eq!(rig.read(host, 0x08A4), 1);
    // Excessive errors are not fatal, and end when the errors do.
    rig.advance_ms(2_000);
    assert_eq!(rig.read(host, 0x0895), 0);
    assert!(rig.bus.get(host).is_on_bus());
}

#[test]
fn ten_errors_spread_over_more_than_ten_seconds_are_not() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    for _ in 0..20 {
        rig.bus.inject(Fault::Deafen { device: host.id(), messages: 1 });
        rig.advance_ms(1_200);
        assert_eq!(rig.read(host, 0x0895), 0);
    }
}

#[test]
fn a_monitor_plugged_into_the_hosts_connector_shows() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.bus.get_mut(host).plug_monitor(true);
    assert_eq!(rig.read(host, 0x0895), 0x01);
    rig.bus.get_mut(host).plug_monitor(false);
    assert_eq!(rig.read(host, 0x0895), 0);
}

#[test]
fn the_scan_time_is_the_time_between_the_boards_two_previous_turns() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.read_word(host, 0x0898), 3, "the shortest scan");
    let data = StationData { discrete_bytes: 128, channels: 0 };
    rig.bus.connect(BusInterfaceUnit::new(1, BusTiming::default(), data, data));
    rig.advance_ms(500);
    let scan_ns = rig.bus.scan_time_ns().unwrap();
    assert_eq!(u64::from(rig.read_word(host, 0x0898)), (scan_ns + 500_000) / 1_000_000);
    assert_eq!(rig.read_word(host, 0x0898), 20);
}

#[test]
fn off_the_bus_the_scan_time_is_ffff() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(3 * SECOND_US);
    assert_eq!(rig.read_word(host, 0x0898), 0xFFFF);
    rig.bus.advance_to(4 * SECOND_US);
    assert_eq!(rig.read_word(host, 0x0898), 3);
    rig.bus.inject(Fault::Disconnect { device: host.id(), for_us: 3 * SECOND_US });
    rig.advance_ms(2_000);
    assert_eq!(rig.read_word(host, 0x0898), 0xFFFF);
    rig.advance_ms(2_000);
    assert_eq!(rig.read_word(host, 0x0898), 3);
}

#[test]
fn the_revision_can_be_read() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.read(host, 0x0892), 0x21);
}

#[test]
fn a_board_that_fails_sends_no_more_outputs() {
    let (mut rig, [host]) = Rig::started([31]);
    let block =
        DiscreteBlock::new(4, BusTiming::default(), Circuits::Eight, BlockKind::Combination);
    let block = rig.bus.connect(block);
    rig.write(host, 0x3000 + 128 * 4, 0x3C);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(block).outputs() == 0x3C));
    rig.bus.inject(Fault::Inside { device: host.id(), fault: DeviceFault::FailSelfTest(0x01) });
    assert!(!rig.bus.get(host).is_on_bus());
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(block).outputs() == 0));
}

#[test]
fn a_monitor_is_no_change_of_status() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x08B6, 1);
    rig.write_all(host, 0x08A2, &[0; 8]);
    let pulses = rig.bus.get(host).interrupt_pulses();
    rig.bus.get_mut(host).plug_monitor(true);
    rig.advance_ms(500);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A4)), (0, 0));
    assert_eq!(rig.bus.get(host).interrupt_pulses(), pulses);
}

#[test]
fn in_the_status_table_only_the_ok_flag_is_the_hosts() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x0893, 0);
    rig.assert_lawful(&[host]);
    for offset in [0x0892, 0x0894, 0x0895, 0x0896, 0x0897, 0x0898, 0x0899] {
        rig.write(host, offset, 0);
    }
    let violations = rig.bus.get(host).violations();
    assert_eq!(violations.len(), 7);
    assert!(violations.iter().all(|violation| violation.kind == ViolationKind::ReadOnly));
}
