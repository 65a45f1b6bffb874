//! Chapter 11: global data.

use super::rig::{COMPLETE, Rig, lengths};

#[test]
fn global_data_reaches_every_other_host_in_every_scan() {
    // The manual's example: 128 bytes from 30 to 29 and 31.
    let (mut rig, [b, a, c]) = Rig::started([29, 30, 31]);
    assert_eq!(rig.configure(a, [0x10, 0xC0, 128, 0, 128]), COMPLETE);
    rig.advance_ms(2_000);
    for round in 0..5_u8 {
        let data: Vec<u8> = (0..128).map(|byte| byte ^ round).collect();
        rig.write_all(a, 0x1F80, &data);
        rig.advance_ms(30);
        for host in [b, c] {
            let buffer: [u8; 128] = rig.read_array(host, 0x2000 + 128 * 30);
            assert_eq!(buffer, data[..]);
            assert_eq!(rig.device(host, 30)[3..7], [0x10, 0xC0, 128, 0]);
        }
    }
    rig.assert_lawful(&[a, b, c]);
}

#[test]
fn none_is_sent_until_the_length_is_set() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    rig.write_all(a, 0x1F80, &[1; 128]);
    rig.advance_ms(100);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [0; 128]);
}

#[test]
fn only_the_set_length_is_sent() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(a, lengths(2, 0, 128)), COMPLETE);
    rig.write_all(a, 0x1F80, &[1; 128]);
    rig.advance_ms(2_000);
    assert_eq!(rig.read_array(b, 0x2000 + 128 * 30), [1, 1, 0, 0]);
}

#[test]
fn each_byte_costs_72_microseconds_of_every_scan() {
    let (mut rig, [a, _, _, _]) = Rig::started([28, 29, 30, 31]);
    let before_ns = rig.bus.scan_time_ns().unwrap();
    assert_eq!(rig.configure(a, lengths(100, 0, 128)), COMPLETE);
    rig.advance_ms(3_000);
    let added_ns = rig.bus.scan_time_ns().unwrap() - before_ns;
    assert!((71_000..73_000).contains(&(added_ns / 100)), "{added_ns}");
}

#[test]
fn data_that_changes_faster_than_the_scan_is_missed() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(a, lengths(1, 0, 128)), COMPLETE);
    rig.advance_ms(2_000);
    let mut seen = std::collections::BTreeSet::new();
    for step in 0..200 {
        rig.write(a, 0x1F80, step);
        rig.advance_ms(1);
        seen.insert(rig.read(b, 0x2000 + 128 * 30));
    }
    assert!((60..80).contains(&seen.len()), "{}", seen.len());
}
