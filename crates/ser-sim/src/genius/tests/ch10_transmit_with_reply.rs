//! Chapter 10: the Transmit Datagram with Reply command.

use super::rig::{COMPLETE, PROCESS_ERROR, Rig, SECOND_US, SYNTAX_ERROR};
use crate::genius::{BusInterfaceUnit, BusTiming, DeviceFault, Fault, Side, StationData};

#[test]
fn the_reply_comes_into_the_read_buffer_and_not_into_the_queue() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 6, channels: 6 };
    let unit = rig.bus.connect(BusInterfaceUnit::new(
        3,
        BusTiming::default(),
        data,
        StationData::default(),
    ));
    rig.bus.get_mut(unit).force_point(Side::Inputs, 9, Some(true));
    rig.bus.get_mut(unit).force_channel(Side::Inputs, 5, Some(0x0102));
    rig.advance_ms(200);

    let mut tables = Vec::new();
    for table in [0, 2] {
        rig.write(host, 0x08D2, table);
        // To, function, subfunctions, priority, length.
        assert_eq!(rig.command(host, 3, &[3, 0x20, 0x40, 0x41, 0, 1, 0]), COMPLETE);
        assert_eq!(rig.read(host, 0x08CA), 19);
        let reply: [u8; 19] = rig.read_array(host, 0x09C2);
        assert_eq!(reply[0], table);
        tables.push(reply);
    }
    assert_eq!(tables[0][1..], [0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF]);
    assert_eq!(tables[1][1..], [0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x02, 0x01]);
    assert_eq!(rig.read_datagram(host), None);
}

#[test]
fn each_of_the_four_force_tables_is_another_one() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 1, channels: 1 };
    let unit = rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.bus.get_mut(unit).force_point(Side::Inputs, 0, Some(true));
    rig.bus.get_mut(unit).force_channel(Side::Outputs, 0, Some(0x1234));
    rig.bus.get_mut(unit).force_point(Side::Outputs, 7, Some(false));
    rig.advance_ms(200);
    let expected = [[0, 1, 0, 0], [1, 0x80, 0xFF, 0xFF], [2, 1, 0, 0], [3, 0, 0x34, 0x12]];
    for (table, expected) in (0..).zip(expected) {
        rig.write(host, 0x08D2, table);
        assert_eq!(rig.command(host, 3, &[3, 0x20, 0x40, 0x41, 0, 1, 0]), COMPLETE);
        assert_eq!((rig.read(host, 0x08CA), rig.read_array(host, 0x09C2)), (4, expected));
    }
}

#[test]
fn a_table_of_128_bytes_comes_whole() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 128, channels: 0 };
    let unit = rig.bus.connect(BusInterfaceUnit::new(
        3,
        BusTiming::default(),
        data,
        StationData::default(),
    ));
    rig.bus.get_mut(unit).force_point(Side::Inputs, 8 * 128 - 1, Some(true));
    rig.advance_ms(200);
    rig.write(host, 0x08D2, 0);
    assert_eq!(rig.command(host, 3, &[3, 0x20, 0x40, 0x41, 0, 1, 0]), COMPLETE);
    assert_eq!(rig.read(host, 0x08CA), 129);
    let reply: [u8; 129] = rig.read_array(host, 0x09C2);
    assert_eq!((reply[0], &reply[1..128], reply[128]), (0, &[0; 127][..], 0x80));
}

#[test]
fn it_cannot_be_broadcast() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.command(host, 3, &[255, 0x20, 0x02, 0x03, 0, 0, 0]), SYNTAX_ERROR);
    assert_eq!(rig.command(host, 3, &[32, 0x20, 0x02, 0x03, 0, 0, 0]), SYNTAX_ERROR);
    assert_eq!(rig.command(host, 3, &[30, 113, 0x02, 0x03, 0, 0, 0]), SYNTAX_ERROR);
}

#[test]
fn without_a_reply_it_ends_after_ten_seconds() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for to in [31, 5] {
        let before_us = rig.bus.now_us();
        assert_eq!(rig.command(host, 3, &[to, 0x40, 0x50, 0x50, 0, 1, 0]), PROCESS_ERROR);
        let took_us = rig.bus.now_us() - before_us;
        assert!((10 * SECOND_US..10 * SECOND_US + 10_000).contains(&took_us), "{took_us}");
    }
    assert!(rig.read_datagram(other).is_some(), "the question did arrive");
}

#[test]
fn a_reply_with_other_codes_or_from_someone_else_goes_into_the_queue() {
    let (mut rig, [a, b, c]) = Rig::started([29, 30, 31]);
    rig.start_command(a, 3, &[30, 0x40, 0x50, 0x51, 0, 1, 0]);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(b).ram()[0x08A8] == 1));
    assert_eq!(rig.transmit(b, 29, [0x40, 0x52], 0, &[1]), COMPLETE);
    assert_eq!(rig.transmit(c, 29, [0x40, 0x51], 0, &[2]), COMPLETE);
    assert_eq!(rig.read(a, 0x08C2), 2);
    assert_eq!(rig.transmit(b, 29, [0x40, 0x51], 0, &[3]), COMPLETE);
    assert_eq!(rig.complete_command(a), COMPLETE);
    assert_eq!((rig.read(a, 0x08CA), rig.read(a, 0x09C2)), (1, 3));
    assert_eq!(rig.read_datagram(a), Some(([30, 0x40, 0x52, 1], vec![1])));
    assert_eq!(rig.read_datagram(a), Some(([31, 0x40, 0x51, 1], vec![2])));
}

#[test]
fn a_reply_that_comes_too_late_goes_into_the_queue() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.command(a, 3, &[31, 0x40, 0x50, 0x51, 0, 1, 0]), PROCESS_ERROR);
    assert_eq!(rig.transmit(b, 30, [0x40, 0x51], 0, &[3]), COMPLETE);
    assert_eq!(rig.read_datagram(a), Some(([31, 0x40, 0x51, 1], vec![3])));
}

#[test]
fn a_lost_reply_is_the_same_as_none() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 1, channels: 0 };
    rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.advance_ms(200);
    rig.start_command(host, 3, &[3, 0x20, 0x40, 0x41, 1, 1, 0]);
    let question = rig.bus.traffic().background + 1;
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.traffic().background == question));
    // The rest of this turn is over before the answer begins.
    rig.advance_ms(2);
    rig.bus.inject(Fault::Deafen { device: host.id(), messages: 1 });
    assert_eq!(rig.complete_command(host), PROCESS_ERROR);
}

#[test]
fn a_question_of_high_priority_does_not_wait() {
    let (mut rig, [low, host, other]) = Rig::started([1, 30, 31]);
    for (priority, waits) in [(0, true), (1, false)] {
        // Another device takes the only place of the next scans.
        for _ in 0..10 {
            rig.start_command(low, 0x82, &[31, 0x40, 0x50, 0, 0]);
            rig.wait_for(low, 0x08C2, 0);
        }
        let before = rig.bus.traffic().scans;
        assert_eq!(rig.command(host, 3, &[31, 0x20, 0x00, 0x01, priority, 0, 0]), COMPLETE);
        let scans = rig.bus.traffic().scans - before;
        assert_eq!(scans >= 9, waits, "priority {priority}: {scans} scans");
        rig.advance_ms(100);
        while rig.read_datagram(other).is_some() {}
    }
}

#[test]
fn without_memory_for_it_it_is_a_process_error_at_once() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    let fault = DeviceFault::OutOfMemory { datagrams: 1 };
    rig.bus.inject(Fault::Inside { device: host.id(), fault });
    let before_us = rig.bus.now_us();
    let ask = |rig: &mut Rig| rig.command(host, 3, &[31, 0x20, 0x00, 0x01, 0, 0, 0]);
    assert_eq!(ask(&mut rig), PROCESS_ERROR);
    assert!(rig.bus.now_us() - before_us < SECOND_US);
    assert_eq!(ask(&mut rig), COMPLETE);
}

#[test]
fn question_and_reply_have_up_to_134_bytes() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    rig.write_all(a, 0x08D2, &[7; 134]);
    rig.start_command(a, 3, &[31, 0x40, 0x50, 0x51, 0, 134, 0]);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(b).ram()[0x08A8] == 1));
    assert_eq!(rig.read_datagram(b), Some(([30, 0x40, 0x50, 1], vec![7; 134])));
    assert_eq!(rig.transmit(b, 30, [0x40, 0x51], 0, &[8; 134]), COMPLETE);
    assert_eq!(rig.complete_command(a), COMPLETE);
    assert_eq!((rig.read(a, 0x08CA), rig.read_array(a, 0x09C2)), (134, [8; 134]));
    assert_eq!(rig.command(a, 3, &[31, 0x40, 0x50, 0x51, 0, 135, 0]), SYNTAX_ERROR);
}
