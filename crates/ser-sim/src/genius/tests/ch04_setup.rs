//! Chapter 4: the setup table and Read ID requests to the board.

use super::rig::{COMPLETE, Rig, SECOND_US, lengths};
use crate::genius::{Board, BoardOptions, BusTiming};

#[test]
fn the_host_configures_in_the_window_before_the_bus_and_loses_no_time() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(1_700_000);
    rig.wait_for(host, 0x0893, 1);
    let ok_us = rig.bus.now_us();
    assert_eq!(rig.configure(host, [0x00, 0xC0, 4, 0, 16]), COMPLETE);
    assert!(rig.bus.advance_until(2 * SECOND_US, |bus| bus.get(host).is_on_bus()));
    assert_eq!(rig.bus.now_us(), ok_us + 1_500_000);
    assert_eq!(rig.read_array(host, 0x0883), [0x00, 0xC0, 4, 0, 16]);
}

#[test]
fn a_read_id_is_answered_with_the_setup_and_without_the_host() {
    let (mut rig, [host, asker]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(host, [0x34, 0x12, 6, 9, 128]), COMPLETE);
    rig.wait_for(asker, 0x1E02 + 8 * 30, 0);
    rig.wait_for(asker, 0x1E02 + 8 * 30, 1);
    let entry = rig.device(asker, 30);
    assert_eq!(entry[3..], [0x34, 0x12, 6, 9, 0b11]);

    // The asking host may also ask itself.
    let status = rig.command(asker, 3, &[30, 0x20, 0x00, 0x01, 0, 0, 0]);
    assert_eq!(status, COMPLETE);
    assert_eq!(rig.read(asker, 0x08CA), 12);
    let reply: [u8; 12] = rig.read_array(asker, 0x09C2);
    assert_eq!(reply[..2], [6, 9]);
    assert_eq!(reply[4], 0b110);
    assert_eq!(reply[5..7], [0x34, 0x12]);
    assert_eq!((reply[10], reply[11]), (entry[0], 0x10));
    assert_eq!(rig.read(host, 0x08A8), 0, "nothing for the asked host");
}

#[test]
fn the_switches_are_read_at_reset_only() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.bus.get_mut(host).set_switches(0xE0 | 20);
    rig.advance_ms(100);
    assert_eq!((rig.read(host, 0x0882), rig.bus.get(host).number()), (0xFF, 31));
    rig.bus.get_mut(host).hold_reset();
    rig.bus.get_mut(host).release_reset();
    rig.advance_ms(2_000);
    assert_eq!((rig.read(host, 0x0882), rig.bus.get(host).number()), (0xE0 | 20, 20));
}

#[test]
fn the_host_cannot_change_the_switches() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x0882, 3);
    assert_eq!(rig.configure(host, lengths(2, 0, 128)), COMPLETE);
    assert_eq!((rig.read(host, 0x0882), rig.bus.get(host).number()), (0xFF, 31));
    assert_eq!(rig.bus.get(host).violations().len(), 1);
}

#[test]
fn a_board_at_another_rate_than_the_bus_does_not_get_on_it() {
    let mut rig = Rig::new();
    let wrong = rig.bus.connect(Board::powered(BoardOptions::at(30).rate(BusTiming::K38)));
    let [right] = rig.connect([31]);
    rig.bus.advance_to(6 * SECOND_US);
    assert_eq!(rig.read_word(wrong, 0x0898), 0xFFFF);
    assert_ne!(rig.read_word(wrong, 0x0896), 0, "it hears noise");
    assert_eq!(rig.read_word(right, 0x0898), 3);
    assert_eq!(rig.device(right, 30)[2], 0);
}

#[test]
fn a_read_id_is_answered_with_high_priority() {
    let (mut rig, [low, host, asker]) = Rig::started([1, 30, 31]);
    for round in 0..5 {
        // Another device takes the only place in every scan, before the host's turn comes.
        for _ in 0..15 {
            rig.start_command(low, 0x82, &[31, 0x40, 0x50, 0, 0]);
            rig.wait_for(low, 0x08C2, 0);
        }
        rig.start_command(asker, 3, &[30, 0x20, 0x00, 0x01, 1, 0, 0]);
        let before = rig.bus.traffic().scans;
        assert_eq!(rig.complete_command(asker), COMPLETE);
        let scans = rig.bus.traffic().scans - before;
        assert!(scans <= 2, "round {round}: {scans} scans");
        rig.advance_ms(100);
    }
    rig.assert_lawful(&[low, host, asker]);
}
