//! Chapter 9: lockout of the tables.

use super::rig::{COMPLETE, Host, Rig, SECOND_US, lengths};
use crate::genius::{
    BlockKind, BusInterfaceUnit, BusTiming, Circuits, DiscreteBlock, StationData, ViolationKind,
};

/// The manual's example algorithm for a request.
fn request(rig: &mut Rig, host: Host) -> bool {
    if rig.read(host, 0x0A49) != 0 || rig.read(host, 0x0A48) != 0 {
        return false;
    }
    rig.write(host, 0x0A48, 1);
    rig.wait_for(host, 0x0A49, 1);
    true
}

/// The manual's example algorithm for the release.
fn release(rig: &mut Rig, host: Host) -> bool {
    if rig.read(host, 0x0A49) != 1 || rig.read(host, 0x0A48) != 1 {
        return false;
    }
    rig.write(host, 0x0A48, 0);
    rig.wait_for(host, 0x0A49, 0);
    true
}

#[test]
fn the_state_follows_the_request() {
    let (mut rig, [host]) = Rig::started([31]);
    assert!(!release(&mut rig, host));
    assert!(request(&mut rig, host));
    assert!(!request(&mut rig, host), "it is locked already");
    assert_eq!(rig.read(host, 0x08A9), 1, "lockout grant");
    rig.write(host, 0x08A9, 0);
    assert!(release(&mut rig, host));
    assert_eq!(rig.read(host, 0x08A9), 0, "for the grant only");
    assert!(request(&mut rig, host));
    rig.assert_lawful(&[host]);
}

#[test]
fn it_is_not_granted_in_the_same_moment() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x0A48, 1);
    assert_eq!(rig.read(host, 0x0A49), 0);
}

#[test]
fn during_a_lockout_inputs_wait_and_outputs_repeat() {
    let (mut rig, [host]) = Rig::started([31]);
    let block =
        DiscreteBlock::new(2, BusTiming::default(), Circuits::Eight, BlockKind::Combination);
    let block = rig.bus.connect(block);
    rig.bus.get_mut(block).set_inputs(1);
    rig.write(host, 0x3100, 11);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(block).outputs() == 11));

    assert!(request(&mut rig, host));
    rig.bus.get_mut(block).set_inputs(2);
    rig.write(host, 0x3100, 22);
    rig.advance_ms(500);
    assert_eq!(rig.read(host, 0x2100), 1, "no new inputs");
    assert_eq!(rig.bus.get(block).outputs(), 11, "the outputs before the lockout, over and over");

    assert!(release(&mut rig, host));
    rig.advance_ms(20);
    assert_eq!(rig.read(host, 0x2100), 2);
    assert_eq!(rig.bus.get(block).outputs(), 22);
}

#[test]
fn a_device_that_logs_in_during_a_lockout_gets_no_outputs_that_nobody_wrote() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 100, channels: 0 };
    assert!(request(&mut rig, host));
    rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.wait_for(host, 0x1E02 + 8 * 3, 1);
    rig.advance_ms(200);
    let locked_ns = rig.bus.scan_time_ns().unwrap();
    assert!(release(&mut rig, host));
    rig.advance_ms(200);
    assert_eq!(rig.bus.scan_time_ns().unwrap() - locked_ns, 100 * BusTiming::default().byte_ns());
}

#[test]
fn during_a_lockout_global_data_repeats_and_what_comes_waits() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    for host in [a, b] {
        assert_eq!(rig.configure(host, lengths(2, 2, 128)), COMPLETE);
    }
    rig.write_all(a, 0x1F80, &[1, 2]);
    rig.write_all(a, 0x3000 + 128 * 31, &[3, 4]);
    rig.advance_ms(3_000);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [1, 2]);
    assert_eq!(rig.read_array(b, 0x1F00), [3, 4]);

    assert!(request(&mut rig, a));
    rig.write_all(a, 0x1F80, &[5, 6]);
    rig.write_all(a, 0x3000 + 128 * 31, &[7, 8]);
    rig.write_all(b, 0x1F80, &[9, 9]);
    rig.advance_ms(500);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [1, 2]);
    assert_eq!(rig.read_array(b, 0x1F00), [3, 4]);
    assert_eq!(rig.read_array(a, 0x2000 + 128 * 31), [0, 0]);
    assert!(release(&mut rig, a));
    rig.advance_ms(50);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [5, 6]);
    assert_eq!(rig.read_array(b, 0x1F00), [7, 8]);
    assert_eq!(rig.read_array(a, 0x2000 + 128 * 31), [9, 9]);
}

#[test]
fn datagrams_and_the_heartbeat_go_on_during_a_lockout() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert!(request(&mut rig, a));
    rig.write(a, 0x0893, 0);
    rig.wait_for(a, 0x0893, 1);
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), COMPLETE);
    assert!(rig.read_datagram(b).is_some());
}

#[test]
fn breaking_the_rules_is_noticed() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x0A49, 0);
    rig.write(host, 0x0A48, 1);
    rig.write(host, 0x0A48, 0);
    rig.advance_ms(10);
    assert!(request(&mut rig, host));
    rig.write(host, 0x0A48, 1);
    let kinds: Vec<_> =
        rig.bus.get(host).violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(kinds, [ViolationKind::Lockout; 3]);
}
