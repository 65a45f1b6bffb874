//! Chapter 10: the Transmit Datagram command.

use super::rig::{COMPLETE, PROCESS_ERROR, Rig, SYNTAX_ERROR};
use crate::genius::{
    BlockKind, BusInterfaceUnit, BusTiming, Circuits, DeviceFault, DiscreteBlock, Fault,
    StationData,
};

#[test]
fn a_directed_datagram_arrives_and_is_acknowledged() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    let data: Vec<u8> = (0..128).collect();
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &data), COMPLETE);
    assert_eq!(rig.read_datagram(b), Some(([30, 0x40, 0x50, 1], data)));
    assert_eq!(rig.read_datagram(a), None);
}

#[test]
fn block_and_buffer_are_clear_when_the_message_is_out() {
    let (mut rig, [a, _]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1, 2, 3]), COMPLETE);
    assert_eq!(rig.read_array(a, 0x08C3), [0; 15]);
    assert_eq!(rig.read_array(a, 0x08D2), [0; 240]);
}

#[test]
fn a_broadcast_reaches_all_and_comes_back_to_the_sender() {
    let (mut rig, [a, b, c]) = Rig::started([29, 30, 31]);
    assert_eq!(rig.transmit(a, 255, [0x40, 0x50], 0, &[5]), COMPLETE);
    for host in [a, b, c] {
        assert_eq!(rig.read_datagram(host), Some(([29, 0x40, 0x50, 0], vec![5])));
    }
}

#[test]
fn wrong_device_numbers_function_codes_and_lengths_are_syntax_errors() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    for options in [
        [32, 0x20, 0x13, 0, 0],
        [254, 0x20, 0x13, 0, 0],
        [31, 113, 0x13, 0, 0],
        [31, 255, 0x13, 0, 0],
        [31, 0x20, 0x13, 0, 135],
    ] {
        assert_eq!(rig.command(a, 2, &options), SYNTAX_ERROR, "{options:?}");
    }
    assert_eq!(rig.command(a, 2, &[31, 112, 0x13, 0, 134]), COMPLETE);
    assert!(rig.read_datagram(b).is_some());
    assert_eq!(rig.read_datagram(b), None);
}

#[test]
fn without_an_acknowledgement_it_is_a_process_error() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(a, 5, [0x40, 0x50], 0, &[1]), PROCESS_ERROR, "nobody is there");
    rig.start_transmit(a, 31, [0x40, 0x50], 0, &[1]);
    rig.bus.inject(Fault::Disconnect { device: b.id(), for_us: 5_000 });
    assert_eq!(rig.complete_command(a), PROCESS_ERROR, "nobody hears");
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), COMPLETE, "sent again");
}

#[test]
fn without_memory_for_it_it_is_a_process_error_and_can_be_sent_again() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    let fault = DeviceFault::OutOfMemory { datagrams: 1 };
    rig.bus.inject(Fault::Inside { device: a.id(), fault });
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), PROCESS_ERROR);
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), COMPLETE);
    assert!(rig.read_datagram(b).is_some());
    assert_eq!(rig.read_datagram(b), None);
}

#[test]
fn with_the_clear_status_bit_the_block_is_free_at_once_and_nothing_is_reported() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    rig.write_all(a, 0x08A2, &[0; 8]);
    // This is faster than the bus, on which a scan takes 3 ms.
    for number in 0..4 {
        rig.write(a, 0x08D2, number);
        rig.start_command(a, 0x82, &[31, 0x40, 0x50, 0, 1]);
        rig.wait_for(a, 0x08C2, 0);
    }
    rig.start_command(a, 0x82, &[32, 0x40, 0x50, 0, 1]);
    rig.wait_for(a, 0x08C2, 0);
    rig.advance_ms(100);
    assert_eq!(rig.read(a, 0x08A7), 0);
    for number in 0..4 {
        assert_eq!(rig.read_datagram(b), Some(([30, 0x40, 0x50, 1], vec![number])));
    }
    assert_eq!(rig.read_datagram(b), None);
}

#[test]
fn normal_priority_waits_for_a_scan_without_a_datagram_and_high_priority_does_not() {
    let (mut rig, hosts) = Rig::started([28, 29, 30, 31]);
    let [_, _, _, receiver] = hosts;
    for (priority, scans) in [(0, 3..=4), (1, 1..=2)] {
        let before = rig.bus.traffic().scans;
        for host in &hosts[..3] {
            rig.start_transmit(*host, 31, [0x40, 0x50], priority, &[1]);
        }
        for host in &hosts[..3] {
            assert_eq!(rig.complete_command(*host), COMPLETE);
        }
        let took = rig.bus.traffic().scans - before;
        assert!(scans.contains(&took), "priority {priority}: {took} scans");
        let mut senders = [(); 3].map(|()| rig.read_datagram(receiver).unwrap().0[0]);
        senders.sort_unstable();
        assert_eq!(senders, [28, 29, 30]);
    }
}

#[test]
fn a_block_takes_no_more_than_16_bytes() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.bus.connect(DiscreteBlock::new(
        2,
        BusTiming::default(),
        Circuits::Eight,
        BlockKind::Inputs,
    ));
    rig.advance_ms(100);
    assert_eq!(rig.transmit(host, 2, [0x20, 0x04], 0, &[0; 16]), COMPLETE);
    assert_eq!(rig.transmit(host, 2, [0x20, 0x04], 0, &[0; 17]), PROCESS_ERROR);
}

#[test]
fn off_the_bus_nothing_can_be_sent() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(2_000_000);
    assert_eq!(rig.transmit(host, 30, [0x40, 0x50], 0, &[1]), PROCESS_ERROR);
}

#[test]
fn a_board_that_loses_the_bus_ends_the_command_with_a_process_error() {
    let (mut rig, [a, _]) = Rig::started([30, 31]);
    rig.bus.inject(Fault::Disconnect { device: a.id(), for_us: 5_000_000 });
    rig.advance_ms(100);
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), PROCESS_ERROR);
}

#[test]
fn a_reply_to_a_datagram_without_reply_waits_in_the_receive_queue() {
    let (mut rig, [host]) = Rig::started([31]);
    let data = StationData { discrete_bytes: 2, channels: 0 };
    rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.wait_for(host, 0x1E02 + 8 * 3, 1);
    assert_eq!(rig.transmit(host, 3, [0x20, 0x40], 0, &[1]), COMPLETE);
    rig.advance_ms(100);
    assert_eq!(rig.read_datagram(host), Some(([3, 0x20, 0x41, 1], vec![1, 0, 0])));
}

#[test]
fn a_datagram_lengthens_the_scan_in_which_it_is_sent() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let data = StationData { discrete_bytes: 64, channels: 0 };
    rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.advance_ms(500);
    for (priority, len) in [(0, 10), (1, 10), (0, 128), (1, 128)] {
        let quiet_ns = rig.bus.scan_time_ns().unwrap();
        rig.start_transmit(host, 31, [0x40, 0x50], priority, &vec![1; len]);
        let mut longest_ns = 0;
        while rig.read(host, 0x08C2) < 4 {
            rig.advance_ms(1);
            longest_ns = longest_ns.max(rig.bus.scan_time_ns().unwrap());
        }
        let end = rig.bus.traffic().scans + 1;
        assert!(rig.bus.advance_until(1_000_000, |bus| bus.traffic().scans == end));
        longest_ns = longest_ns.max(rig.bus.scan_time_ns().unwrap());
        assert_eq!(
            longest_ns - quiet_ns,
            BusTiming::default().datagram_ns(len),
            "{priority} {len}"
        );
        rig.advance_ms(100);
        assert!(rig.read_datagram(other).is_some());
    }
}
