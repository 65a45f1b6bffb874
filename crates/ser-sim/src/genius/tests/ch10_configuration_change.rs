//! Chapter 10: the Configuration Change command.

use super::rig::{COMPLETE, PROCESS_ERROR, Rig, SECOND_US, SYNTAX_ERROR, lengths};
use crate::genius::{BlockKind, BusTiming, Circuits, DiscreteBlock};

#[test]
fn the_board_leaves_the_bus_for_1_5_seconds_and_logs_everyone_out() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    assert_eq!(rig.configure(host, lengths(4, 0, 128)), COMPLETE);
    let changed_us = rig.bus.now_us();
    assert!(!rig.bus.get(host).is_on_bus());
    assert_eq!(rig.read_word(host, 0x0898), 0xFFFF);
    assert_eq!(rig.device(host, 31)[2], 0);
    assert_eq!(rig.read(host, 0x08A5), 1);
    rig.wait_for(other, 0x1E02 + 8 * 30, 0);
    assert!(rig.bus.advance_until(2 * SECOND_US, |bus| bus.get(host).is_on_bus()));
    assert_eq!(rig.bus.now_us(), changed_us + 1_500_000);
    rig.wait_for(host, 0x1E02 + 8 * 31, 1);
    rig.wait_for(other, 0x1E02 + 8 * 30, 1);
    assert_eq!(rig.device(other, 30)[5], 4, "the new length is in effect");
}

#[test]
fn with_a_new_buffer_length_alone_the_board_goes_on_transmitting() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let block =
        DiscreteBlock::new(2, BusTiming::default(), Circuits::Eight, BlockKind::Combination);
    let block = rig.bus.connect(block);
    rig.write(host, 0x3100, 5);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(block).outputs() == 5));

    assert_eq!(rig.configure(host, lengths(0, 0, 16)), COMPLETE);
    let changed_us = rig.bus.now_us();
    assert!(rig.bus.get(host).is_on_bus());
    assert_eq!((rig.device(host, 31)[2], rig.device(host, 2)[2]), (0, 0));
    rig.advance_ms(1_400);
    assert_eq!(rig.bus.get(block).outputs(), 0, "without outputs the block falls to its defaults");
    assert_eq!((rig.device(host, 31)[2], rig.device(host, 2)[2]), (0, 0));
    assert_eq!(rig.device(other, 30)[2], 1, "the other one has heard it all the time");
    rig.wait_for(host, 0x1E02 + 8 * 31, 1);
    assert!(rig.bus.now_us() - changed_us >= 1_500_000);
    rig.wait_for(host, 0x1E02 + 8 * 2, 1);
}

#[test]
fn what_is_out_of_range_is_refused_and_the_old_values_come_back() {
    let (mut rig, [host]) = Rig::started([31]);
    for wrong in [lengths(129, 0, 128), lengths(0, 129, 128), lengths(0, 0, 129), lengths(0, 0, 0)]
    {
        assert_eq!(rig.configure(host, wrong), SYNTAX_ERROR);
        assert_eq!(rig.read_array(host, 0x0883), lengths(0, 0, 128));
        assert!(rig.bus.get(host).is_on_bus());
    }
    assert_eq!(rig.configure(host, lengths(128, 128, 128)), COMPLETE);
}

#[test]
fn a_change_that_changes_nothing_says_so_and_costs_nothing() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 128)), PROCESS_ERROR);
    assert!(rig.bus.get(host).is_on_bus());
    assert_eq!(rig.device(host, 31)[2], 1);
}

#[test]
fn the_setup_table_alone_changes_nothing() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write_all(host, 0x0883, &lengths(8, 0, 128));
    rig.advance_ms(2_000);
    assert_eq!(rig.device(other, 30)[5], 0);
}

#[test]
fn each_setting_but_the_buffer_length_takes_the_board_off_the_bus() {
    for (setup, stays) in [
        ([0x34, 0x12, 0, 0, 128], false),
        (lengths(1, 0, 128), false),
        (lengths(0, 1, 128), false),
        (lengths(1, 0, 64), false),
        (lengths(0, 0, 64), true),
    ] {
        let (mut rig, [host, other]) = Rig::started([30, 31]);
        assert_eq!(rig.configure(host, setup), COMPLETE);
        assert_eq!(rig.bus.get(host).is_on_bus(), stays, "{setup:?}");
        assert_eq!(rig.device(host, 31)[2], 0, "{setup:?}");
        rig.advance_ms(1_400);
        assert_eq!(rig.device(host, 31)[2], 0, "{setup:?}");
        assert_eq!(rig.device(other, 30)[2], u8::from(stays), "{setup:?}");
        rig.wait_for(host, 0x1E02 + 8 * 31, 1);
        assert_eq!(rig.read_array(host, 0x0883), setup);
    }
}

#[test]
fn the_options_do_not_matter() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write_all(host, 0x0883, &lengths(3, 0, 128));
    assert_eq!(rig.command(host, 4, &[0xFF; 14]), COMPLETE);
    assert_eq!(rig.read_array(host, 0x0883), lengths(3, 0, 128));
}
