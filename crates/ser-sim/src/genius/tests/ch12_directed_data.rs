//! Chapter 12: directed control data.

use super::rig::{COMPLETE, Rig, lengths};

#[test]
fn each_host_gets_its_own_data() {
    // The manual's example: 128 bytes from 30 to 29 and 56 bytes to 31.
    let (mut rig, [b, a, c]) = Rig::started([29, 30, 31]);
    assert_eq!(rig.configure(b, lengths(0, 128, 128)), COMPLETE);
    assert_eq!(rig.configure(c, lengths(0, 56, 128)), COMPLETE);
    rig.advance_ms(3_000);
    assert_eq!(
        (rig.device(a, 29)[6], rig.device(a, 31)[6]),
        (128, 56),
        "how much the sender may send"
    );
    // Boards that start with outputs enabled send to everyone who takes data, but only one of them
    // should.
    rig.write(b, 0x1E01 + 8 * 31, 1);
    rig.write(c, 0x1E01 + 8 * 29, 1);
    rig.write_all(a, 0x3000 + 128 * 29, &[2; 128]);
    rig.write_all(a, 0x3000 + 128 * 31, &[3; 128]);
    rig.advance_ms(100);
    assert_eq!(rig.read_array(b, 0x1F00), [2; 128]);
    assert_eq!(rig.read_array(c, 0x1F00), [3; 56]);
    assert_eq!(rig.read_array(c, 0x1F00 + 56), [0; 72], "no more than it asked for");
    rig.assert_lawful(&[a, b, c]);
}

#[test]
fn global_and_directed_data_go_together() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(a, lengths(56, 0, 128)), COMPLETE);
    assert_eq!(rig.configure(b, lengths(0, 128, 128)), COMPLETE);
    rig.write_all(a, 0x1F80, &[7; 56]);
    rig.write_all(a, 0x3000 + 128 * 31, &[8; 128]);
    rig.advance_ms(3_000);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [7; 56]);
    assert_eq!(rig.read_array(b, 0x1F00), [8; 128]);
}

#[test]
fn directed_data_are_new_in_every_scan() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(b, lengths(0, 2, 128)), COMPLETE);
    rig.advance_ms(3_000);
    for round in 1..50 {
        rig.write_all(a, 0x3000 + 128 * 31, &[round, !round]);
        rig.advance_ms(10);
        assert_eq!(rig.read_array(b, 0x1F00), [round, !round]);
    }
}

#[test]
fn none_are_taken_until_the_length_is_set() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    rig.write_all(a, 0x3000 + 128 * 31, &[1; 128]);
    rig.advance_ms(200);
    assert_eq!(rig.device(a, 31)[6], 0);
    assert_eq!(rig.read_array(b, 0x1F00), [0; 128]);
}

#[test]
fn of_two_senders_the_later_one_in_the_scan_counts() {
    let (mut rig, [b, a, c]) = Rig::started([29, 30, 31]);
    assert_eq!(rig.configure(b, lengths(0, 1, 128)), COMPLETE);
    rig.advance_ms(3_000);
    rig.write(a, 0x3000 + 128 * 29, 1);
    rig.write(c, 0x3000 + 128 * 29, 2);
    for _ in 0..20 {
        rig.advance_ms(20);
        assert_eq!(rig.read(b, 0x1F00), 2);
    }
    rig.write(c, 0x1E01 + 8 * 29, 1);
    rig.advance_ms(20);
    assert_eq!(rig.read(b, 0x1F00), 1, "now there is only one");
}
