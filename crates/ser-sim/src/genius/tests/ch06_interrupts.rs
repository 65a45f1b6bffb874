//! Chapter 6: interrupt status and disable tables.

use super::rig::{COMPLETE, Host, Rig};
use crate::genius::{BlockKind, BusTiming, Circuits, DiscreteBlock};

const REQUEST_QUEUE: u16 = 1;
const DEVICE_STATUS: u16 = 3;
const OUTPUTS_SENT: u16 = 4;
const COMMAND_COMPLETE: u16 = 5;
const RECEIVE_QUEUE: u16 = 6;
const LOCKOUT_GRANT: u16 = 7;

/// Clears all flags and disables every condition except one.
fn only(rig: &mut Rig, host: Host, index: u16) {
    for other in 1..8 {
        rig.write(host, 0x08B2 + other, u8::from(other != index));
    }
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(host).take_interrupt();
}

/// Lets a condition occur on the host's board.
fn provoke(rig: &mut Rig, host: Host, other: Host, index: u16) {
    match index {
        REQUEST_QUEUE => {
            assert_eq!(rig.transmit(other, 30, [0x20, 0x20], 0, &[1, 0, 0, 0, 5]), COMPLETE);
        }
        DEVICE_STATUS => {
            let rate = BusTiming::default();
            rig.bus.connect(DiscreteBlock::new(4, rate, Circuits::Eight, BlockKind::Inputs));
        }
        OUTPUTS_SENT => {}
        COMMAND_COMPLETE => {
            rig.read_datagram(host);
        }
        RECEIVE_QUEUE => assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[1]), COMPLETE),
        LOCKOUT_GRANT => rig.write(host, 0x0A48, 1),
        _ => panic!("no such condition"),
    }
    rig.advance_ms(100);
}

const CONDITIONS: [u16; 6] =
    [REQUEST_QUEUE, DEVICE_STATUS, OUTPUTS_SENT, COMMAND_COMPLETE, RECEIVE_QUEUE, LOCKOUT_GRANT];

#[test]
fn each_condition_sets_its_flag_the_summary_and_interrupts() {
    for index in CONDITIONS {
        let (mut rig, [host, other]) = Rig::started([30, 31]);
        only(&mut rig, host, index);
        provoke(&mut rig, host, other, index);
        assert_eq!(rig.read(host, 0x08A2 + index), 1, "flag {index}");
        assert_eq!(rig.read(host, 0x08A2), 1, "summary for {index}");
        assert!(rig.bus.get_mut(host).take_interrupt(), "interrupt for {index}");
    }
}

#[test]
fn a_disabled_condition_sets_only_its_own_flag() {
    for index in CONDITIONS {
        let (mut rig, [host, other]) = Rig::started([30, 31]);
        only(&mut rig, host, 8);
        provoke(&mut rig, host, other, index);
        assert_eq!(rig.read(host, 0x08A2 + index), 1, "flag {index}");
        assert_eq!(rig.read(host, 0x08A2), 0, "summary for {index}");
        assert!(!rig.bus.get_mut(host).take_interrupt(), "interrupt for {index}");
    }
}

#[test]
fn the_summary_of_the_disable_table_disables_all() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    rig.write(host, 0x08B2, 1);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(host).take_interrupt();
    rig.advance_ms(100);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A6)), (0, 1));
    assert!(!rig.bus.get_mut(host).take_interrupt());
}

#[test]
fn flags_stay_until_the_host_clears_them() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    only(&mut rig, host, COMMAND_COMPLETE);
    rig.read_datagram(host);
    rig.advance_ms(500);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A7)), (1, 1));
    rig.write(host, 0x08A7, 0);
    rig.write(host, 0x08A2, 0);
    rig.advance_ms(500);
    assert_eq!((rig.read(host, 0x08A2), rig.read(host, 0x08A7)), (0, 0));
}

#[test]
fn outputs_sent_comes_once_in_every_scan() {
    let (mut rig, [host]) = Rig::started([31]);
    only(&mut rig, host, OUTPUTS_SENT);
    let before = (rig.bus.get(host).interrupt_pulses(), rig.bus.traffic().scans);
    rig.advance_ms(300);
    let after = (rig.bus.get(host).interrupt_pulses(), rig.bus.traffic().scans);
    assert_eq!(after.0 - before.0, 100);
    assert_eq!(after.1 - before.1, 100);
}
