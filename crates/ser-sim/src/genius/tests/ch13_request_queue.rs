//! Chapter 13: memory access datagrams and the request queue.

use ser_proto::genius::{
    MemoryAddress, MemoryContents, MemoryRange, Message, PointMask, WritePoint,
};

use super::rig::{COMPLETE, Host, Rig, SECOND_US};
use crate::genius::ViolationKind;

const READ_DEVICE: u8 = 0x1E;
const WRITE_DEVICE: u8 = 0x20;

/// What the other host sends: length, address, data.
fn access(address: u32, data: &[u8]) -> Vec<u8> {
    let [low, middle, high, _] = address.to_le_bytes();
    let length = u8::try_from(data.len()).unwrap();
    [length, low, middle, high].into_iter().chain(data.iter().copied()).collect()
}

/// The manual's example logic: the buffer at the head when head and tail differ.
fn next_request(rig: &mut Rig, host: Host) -> Option<u16> {
    let [head, tail] = rig.read_array(host, 0x0880);
    (head != tail).then(|| u16::from(head) * 136)
}

/// Sets the status, then moves the head on.
fn finish_request(rig: &mut Rig, host: Host, at: u16, status: u8) {
    rig.write(host, at + 1, status);
    let head = (rig.read(host, 0x0880) + 1) & 0x0F;
    rig.write(host, 0x0880, head);
    rig.advance_ms(1);
}

#[test]
fn a_write_device_waits_in_the_queue_with_its_header() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write_all(host, 0x08A2, &[0; 8]);
    assert_eq!(next_request(&mut rig, host), None);
    let data = access(0x03_0201, &[10, 11, 12]);
    assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &data), COMPLETE);
    assert_eq!(rig.read(host, 0x08A3), 1);
    let at = next_request(&mut rig, host).unwrap();
    assert_eq!(rig.read_array(host, at), [WRITE_DEVICE, 0, 3, 1, 2, 3, 31, 0, 10, 11, 12, 0]);
    finish_request(&mut rig, host, at, 1);
    assert_eq!(next_request(&mut rig, host), None);
    assert_eq!(rig.read(host, at + 1), 0, "the board clears the status");
    assert_eq!(rig.read_datagram(host), None, "it is not in the receive queue");
    rig.assert_lawful(&[host, other]);
}

#[test]
fn a_read_device_is_answered_with_what_the_host_puts_into_the_buffer() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let data = access(0x10, &[0; 4]);
    rig.write_all(other, 0x08D2, &data[..4]);
    rig.start_command(other, 3, &[30, 0x20, READ_DEVICE, 0x1F, 0, 4, 0]);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(host).ram()[0x0881] == 1));
    let at = next_request(&mut rig, host).unwrap();
    assert_eq!(rig.read_array(host, at), [READ_DEVICE, 0, 4, 0x10, 0, 0, 31, 0]);
    rig.write_all(host, at + 8, &[1, 2, 3, 4]);
    finish_request(&mut rig, host, at, 1);
    assert_eq!(rig.complete_command(other), COMPLETE);
    assert_eq!(rig.read(other, 0x08CA), 8);
    assert_eq!(rig.read_array(other, 0x09C2), [4, 0x10, 0, 0, 1, 2, 3, 4]);
}

#[test]
fn an_error_frees_the_buffer_and_nothing_else() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for error in [4, 8] {
        assert_eq!(rig.transmit(other, 30, [0x20, READ_DEVICE], 0, &access(0, &[])), COMPLETE);
        let at = next_request(&mut rig, host).unwrap();
        let background = rig.bus.traffic().background;
        finish_request(&mut rig, host, at, error);
        rig.advance_ms(100);
        assert_eq!(next_request(&mut rig, host), None);
        assert_eq!(rig.bus.traffic().background, background, "no reply");
    }
}

#[test]
fn a_busy_request_comes_again_behind_the_others() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for byte in [1, 2] {
        assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &access(0, &[byte])), COMPLETE);
    }
    rig.write_all(host, 0x08A2, &[0; 8]);
    let mut seen = Vec::new();
    for status in [2, 1, 1] {
        let at = next_request(&mut rig, host).unwrap();
        assert_eq!(rig.read(host, at + 1), 0);
        seen.push(rig.read(host, at + 8));
        finish_request(&mut rig, host, at, status);
    }
    assert_eq!(seen, [1, 2, 1]);
    assert_eq!(rig.read(host, 0x08A3), 1, "it came like a new one");
    assert_eq!(next_request(&mut rig, host), None);
}

#[test]
fn the_tail_never_reaches_the_head_from_behind_and_what_does_not_fit_is_lost() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for byte in 0..17 {
        let data = access(0, &[byte]);
        assert_eq!(
            rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &data),
            COMPLETE,
            "no word of it"
        );
    }
    assert_eq!(rig.read_array(host, 0x0880), [0, 15]);
    for byte in 0..15 {
        let at = next_request(&mut rig, host).unwrap();
        assert_eq!(rig.read(host, at + 8), byte);
        finish_request(&mut rig, host, at, 1);
    }
    assert_eq!(next_request(&mut rig, host), None);
}

#[test]
fn the_queue_goes_round() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    for byte in 0..40 {
        assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &access(0, &[byte])), COMPLETE);
        let at = next_request(&mut rig, host).unwrap();
        assert_eq!(at, u16::from(byte % 16) * 136);
        assert_eq!(rig.read(host, at + 8), byte);
        finish_request(&mut rig, host, at, 1);
    }
    rig.assert_lawful(&[host, other]);
}

#[test]
fn write_point_goes_into_the_queue_and_other_datagrams_do_not() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    assert_eq!(rig.transmit(other, 30, [0x20, 0x0B], 0, &access(0, &[1, 1])), COMPLETE);
    assert!(next_request(&mut rig, host).is_some());
    assert_eq!(rig.read_datagram(host), None);
    // The same subfunctions with another function code mean something else.
    assert_eq!(rig.transmit(other, 30, [0x40, WRITE_DEVICE], 0, &[1]), COMPLETE);
    assert!(rig.read_datagram(host).is_some());
}

#[test]
fn writing_the_tail_hangs_the_queue() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write(host, 0x0881, 0);
    assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &access(0, &[1])), COMPLETE);
    assert_eq!(next_request(&mut rig, host), None);
    assert_eq!(rig.bus.get(host).violations()[0].kind, ViolationKind::TailPointer);
}

#[test]
fn a_head_beyond_the_tail_or_a_missing_status_is_noticed() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write(host, 0x0880, 3);
    rig.advance_ms(1);
    rig.write(host, 0x0880, 0);
    assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &access(0, &[1])), COMPLETE);
    let at = next_request(&mut rig, host).unwrap();
    finish_request(&mut rig, host, at, 0);
    let kinds: Vec<_> =
        rig.bus.get(host).violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(kinds, [ViolationKind::RequestQueue; 2]);
}

const PLACE: MemoryAddress = MemoryAddress::new(0x03_0201).unwrap();

#[test]
fn the_datagrams_of_ser_proto_are_in_the_queue_as_they_are_meant() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let contents = MemoryContents { address: PLACE, contents: [10, 11, 12].into_iter().collect() };
    let masks = [PointMask { and: 0xFE, or: 1 }, PointMask::KEEP];
    for (message, header, data) in [
        (Message::ReadDevice(MemoryRange { address: PLACE, length: 4 }), [0x1E, 4], [0, 0, 0, 0]),
        (Message::WriteDevice(contents), [0x20, 3], [10, 11, 12, 0]),
        (Message::WritePoint(WritePoint { address: PLACE, masks }), [0x0B, 4], [0xFE, 1, 0xFF, 0]),
    ] {
        let [command, length] = header;
        assert_eq!(rig.transmit(other, 30, [0x20, command], 0, &message.to_data()), COMPLETE);
        let at = next_request(&mut rig, host).unwrap();
        assert_eq!(rig.read_array(host, at), [command, 0, length, 1, 2, 3, 31, 0], "{message}");
        assert_eq!(rig.read_array(host, at + 8), data, "{message}");
        finish_request(&mut rig, host, at, 4);
    }
}

#[test]
fn a_reply_from_the_queue_is_one_that_ser_proto_understands() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let question = Message::ReadDevice(MemoryRange { address: PLACE, length: 4 });
    assert_eq!(rig.transmit(other, 30, [0x20, READ_DEVICE], 0, &question.to_data()), COMPLETE);
    let at = next_request(&mut rig, host).unwrap();
    rig.write_all(host, at + 8, &[1, 2, 3, 4]);
    finish_request(&mut rig, host, at, 1);
    rig.advance_ms(100);
    let (header, data) = rig.read_datagram(other).unwrap();
    assert_eq!(header, [30, 0x20, 0x1F, 1]);
    let contents = MemoryContents { address: PLACE, contents: [1, 2, 3, 4].into_iter().collect() };
    assert_eq!(data, Message::ReadDeviceReply(contents).to_data()[..]);
}

#[test]
fn a_request_has_up_to_128_bytes_of_data_each_way() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    let data: Vec<u8> = (1..=128).collect();
    assert_eq!(rig.transmit(other, 30, [0x20, WRITE_DEVICE], 0, &access(0x10, &data)), COMPLETE);
    let at = next_request(&mut rig, host).unwrap();
    assert_eq!(rig.read(host, at + 2), 128);
    assert_eq!(rig.read_array::<128>(host, at + 8), data[..]);
    finish_request(&mut rig, host, at, 1);

    let question = access(0x10, &data);
    let head = &question[..question.len() - data.len()];
    assert_eq!(rig.transmit(other, 30, [0x20, READ_DEVICE], 0, head), COMPLETE);
    let at = next_request(&mut rig, host).unwrap();
    rig.write_all(host, at + 8, &data);
    finish_request(&mut rig, host, at, 1);
    rig.advance_ms(100);
    let (_, reply) = rig.read_datagram(other).unwrap();
    assert_eq!(reply, question);
}
