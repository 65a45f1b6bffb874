//! Chapter 10: the command block, and the Read Datagram command.

use super::rig::{COMPLETE, PROCESS_ERROR, Rig, SYNTAX_ERROR, lengths};
use crate::genius::ViolationKind;

#[test]
fn the_status_goes_from_incoming_over_in_progress_to_complete() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[1, 2, 3]), COMPLETE);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.start_command(host, 1, &[]);
    assert_eq!(rig.read(host, 0x08C2), 1);
    rig.wait_for(host, 0x08C2, 2);
    assert_eq!(rig.read(host, 0x08A7), 0);
    rig.wait_for(host, 0x08C2, 4);
    assert_eq!(rig.read(host, 0x08A7), 1);
}

#[test]
fn status_first_and_command_second_as_in_the_chapters_procedure_works_too() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[7]), COMPLETE);
    rig.write(host, 0x08C2, 1);
    rig.write(host, 0x08C3, 1);
    assert_eq!(rig.complete_command(host), COMPLETE);
    assert_eq!(rig.read(host, 0x09C2), 7);
}

#[test]
fn the_oldest_datagram_comes_with_where_it_is_from_and_what_it_is() {
    let (mut rig, [host, a, b]) = Rig::started([29, 30, 31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    assert_eq!(rig.transmit(a, 29, [0x40, 0x50], 0, &[1, 2, 3]), COMPLETE);
    assert_eq!(rig.read(host, 0x08A8), 1, "receive queue not empty");
    assert_eq!(rig.transmit(b, 255, [0x20, 0x13], 1, &[]), COMPLETE);
    assert_eq!(rig.read_datagram(host), Some(([30, 0x40, 0x50, 1], vec![1, 2, 3])));
    assert_eq!(rig.read_datagram(host), Some(([31, 0x20, 0x13, 0], vec![])));
    rig.assert_lawful(&[host, a, b]);
}

#[test]
fn an_empty_queue_is_a_syntax_error_and_leaves_everything_as_it_was() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write_all(host, 0x09C2, &[9; 4]);
    assert_eq!(rig.command(host, 1, &[1, 2, 3, 4, 5]), SYNTAX_ERROR);
    assert_eq!(rig.read_array(host, 0x09C2), [9; 4]);
    assert_eq!(rig.read_array(host, 0x08C4), [1, 2, 3, 4, 5]);
}

#[test]
fn fifteen_datagrams_wait_and_the_sixteenth_is_lost_without_a_word() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for number in 0..17 {
        assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[number]), COMPLETE);
    }
    for number in 0..15 {
        assert_eq!(rig.read_datagram(host), Some(([31, 0x40, 0x50, 1], vec![number])));
    }
    assert_eq!(rig.read_datagram(host), None);
}

#[test]
fn with_the_clear_status_bit_it_is_not_carried_out() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[1]), COMPLETE);
    rig.write_all(host, 0x08A2, &[0; 8]);
    for command in [0x81, 0x83, 0x84] {
        rig.start_command(host, command, &[]);
        rig.wait_for(host, 0x08C2, 0);
        rig.advance_ms(100);
        assert_eq!((rig.read(host, 0x08C2), rig.read(host, 0x08A7)), (0, 0));
    }
    assert!(rig.read_datagram(host).is_some(), "it is still there");
}

#[test]
fn a_command_that_does_not_exist_is_a_syntax_error() {
    let (mut rig, [host]) = Rig::started([31]);
    for command in [0, 5, 0x3F] {
        assert_eq!(rig.command(host, command, &[]), SYNTAX_ERROR);
    }
}

#[test]
fn a_command_while_one_is_in_progress_is_noticed_and_lost() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.start_command(host, 1, &[]);
    rig.wait_for(host, 0x08C2, 2);
    rig.write(host, 0x08C2, 1);
    assert_eq!(rig.complete_command(host), SYNTAX_ERROR);
    assert_eq!(rig.bus.get(host).violations()[0].kind, ViolationKind::CommandBusy);
}

#[test]
fn the_command_is_in_the_low_six_bits() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[7]), COMPLETE);
    assert_eq!(rig.command(host, 0x41, &[]), COMPLETE);
    assert_eq!(rig.read(host, 0x09C2), 7);
}

#[test]
fn every_end_of_every_command_sets_the_flag_and_interrupts() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x40, 0x50], 0, &[7]), COMPLETE);
    rig.write_all(host, 0x0883, &lengths(0, 0, 128));
    for index in [1, 2, 3, 4, 6, 7] {
        rig.write(host, 0x08B2 + index, 1);
    }
    for (command, options, status) in [
        (1, [0; 7], COMPLETE),
        (1, [0; 7], SYNTAX_ERROR),
        (2, [31, 0x40, 0x50, 0, 0, 0, 0], COMPLETE),
        (2, [99, 0x40, 0x50, 0, 0, 0, 0], SYNTAX_ERROR),
        (2, [5, 0x40, 0x50, 0, 0, 0, 0], PROCESS_ERROR),
        (3, [31, 0x20, 0x00, 0x01, 0, 0, 0], COMPLETE),
        (3, [255, 0x20, 0x00, 0x01, 0, 0, 0], SYNTAX_ERROR),
        (3, [5, 0x20, 0x00, 0x01, 0, 0, 0], PROCESS_ERROR),
        (4, [0; 7], PROCESS_ERROR),
    ] {
        rig.write_all(host, 0x08A2, &[0; 8]);
        let pulses = rig.bus.get(host).interrupt_pulses();
        assert_eq!(rig.command(host, command, &options), status, "{command} {options:?}");
        assert_eq!(
            (rig.read(host, 0x08A2), rig.read(host, 0x08A7)),
            (1, 1),
            "{command} {options:?}"
        );
        assert_eq!(rig.bus.get(host).interrupt_pulses(), pulses + 1, "{command} {options:?}");
    }
}
