//! Chapters 3 and 7: logging in and out.

use super::rig::{PROCESS_ERROR, Rig, SECOND_US, lengths};
use crate::genius::{
    BlockKind, Board, BoardOptions, BusInterfaceUnit, BusTiming, Circuits, DiscreteBlock, Fault,
    StationData, ViolationKind,
};

fn block(number: u8, circuits: Circuits) -> DiscreteBlock {
    DiscreteBlock::new(number, BusTiming::default(), circuits, BlockKind::Combination)
}

#[test]
fn a_device_that_sends_inputs_is_asked_who_it_is_and_entered_in_the_table() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x08A5, 0);
    let mut new = block(12, Circuits::Sixteen);
    new.configure(BlockKind::Combination, 0x0123);
    rig.bus.connect(new);
    rig.wait_for(host, 0x1E02 + 8 * 12, 1);
    // Model, outputs enabled, present, reference, lengths, combination.
    assert_eq!(rig.device(host, 12), [73, 0, 1, 0x23, 0x01, 2, 2, 0b11]);
    assert_eq!(rig.read(host, 0x08A5), 1, "device status change");
}

#[test]
fn block_kinds_are_told_apart() {
    let (mut rig, [host]) = Rig::started([31]);
    let rate = BusTiming::default();
    rig.bus.connect(DiscreteBlock::new(1, rate, Circuits::Eight, BlockKind::Inputs));
    rig.bus.connect(DiscreteBlock::new(2, rate, Circuits::ThirtyTwo, BlockKind::Outputs));
    let data = StationData { discrete_bytes: 6, channels: 6 };
    rig.bus.connect(BusInterfaceUnit::new(3, rate, data, StationData::default()));
    rig.advance_ms(200);
    assert_eq!(rig.device(host, 1)[5..], [1, 0, 0b01]);
    assert_eq!(rig.device(host, 2)[5..], [0, 4, 0b10]);
    assert_eq!(rig.device(host, 3)[5..], [18, 0, 0b01]);
    for number in 1..=3 {
        assert_eq!(rig.device(host, number)[2], 1);
    }
}

#[test]
fn a_device_that_is_silent_for_three_scans_is_logged_out_and_back_in_when_it_sends_again() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(5, Circuits::Eight));
    rig.wait_for(host, 0x1E02 + 8 * 5, 1);
    rig.bus.get_mut(device).set_inputs(0x5A);
    rig.advance_ms(20);
    rig.write_all(host, 0x08A2, &[0; 8]);

    // Counted from the end of a turn of the board: two more turns pass, and on the third it is
    // gone.
    rig.write(host, 0x08A6, 0);
    rig.wait_for(host, 0x08A6, 1);
    let turns = |rig: &Rig| rig.bus.get(host).interrupt_pulses();
    let before = turns(&rig);
    rig.bus.inject(Fault::Disconnect { device: device.id(), for_us: SECOND_US });
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(host).interrupt_pulses() == before + 2));
    assert_eq!(rig.device(host, 5)[2], 1);
    rig.wait_for(host, 0x1E02 + 8 * 5, 0);
    assert_eq!(turns(&rig), before + 3, "the device status change");
    assert_eq!(rig.read(host, 0x08A5), 1);
    assert_eq!(rig.read(host, 0x2000 + 128 * 5), 0x5A, "the input buffer is not cleared");
    rig.wait_for(host, 0x1E02 + 8 * 5, 1);
    assert!(rig.bus.now_us() > 5 * SECOND_US);
}

#[test]
fn a_device_with_more_data_than_a_buffer_holds_is_not_logged_in() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 2)), 4);
    rig.advance_ms(1_600);
    rig.bus.connect(block(6, Circuits::Sixteen));
    rig.bus.connect(block(7, Circuits::ThirtyTwo));
    let rate = BusTiming::default();
    rig.bus.connect(DiscreteBlock::new(8, rate, Circuits::ThirtyTwo, BlockKind::Inputs));
    rig.bus.connect(DiscreteBlock::new(9, rate, Circuits::ThirtyTwo, BlockKind::Outputs));
    rig.advance_ms(500);
    let present = [6, 7, 8, 9].map(|number| rig.device(host, number)[2]);
    assert_eq!(present, [1, 0, 0, 0]);
    // Longer buffers help.
    assert_eq!(rig.configure(host, lengths(0, 0, 4)), 4);
    rig.advance_ms(1_800);
    assert_eq!(rig.device(host, 7)[2], 1);
}

#[test]
fn a_refused_device_is_asked_once_until_it_has_been_away() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 2)), 4);
    rig.advance_ms(1_600);
    let device = rig.bus.connect(block(7, Circuits::ThirtyTwo));
    rig.advance_ms(200);
    let background = rig.bus.traffic().background;
    rig.advance_ms(1_000);
    assert_eq!(rig.bus.traffic().background, background);
    rig.bus.inject(Fault::Disconnect { device: device.id(), for_us: 100_000 });
    rig.advance_ms(300);
    assert_eq!(rig.bus.traffic().background, background + 2, "Read ID and its reply");
    assert_eq!(rig.device(host, 7)[2], 0);
}

#[test]
fn outputs_flow_when_the_board_started_with_outputs_enabled() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(9, Circuits::Sixteen));
    rig.write_all(host, 0x3000 + 128 * 9, &[0x34, 0x12]);
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(device).outputs() == 0x1234));
    assert_eq!(rig.bus.get(device).controllers().collect::<Vec<_>>(), [31]);
}

#[test]
fn with_outputs_disabled_nothing_is_sent_until_the_host_resets_the_flag() {
    let mut rig = Rig::new();
    let host = rig.bus.connect(Board::powered(BoardOptions::at(31).outputs_disabled()));
    let device = rig.bus.connect(block(9, Circuits::Eight));
    rig.bus.advance_to(4 * SECOND_US);
    rig.write(host, 0x3000 + 128 * 9, 0xFF);
    rig.advance_ms(500);
    assert_eq!(rig.device(host, 9)[1..3], [1, 1]);
    assert_eq!(rig.bus.get(device).outputs(), 0);
    assert_eq!(rig.bus.get(device).controllers().count(), 0);

    rig.write(host, 0x1E01 + 8 * 9, 0);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(device).outputs() == 0xFF));
    assert_eq!(rig.bus.get(device).controllers().collect::<Vec<_>>(), [31]);

    // Disabled again, the block falls back to its default outputs.
    rig.write(host, 0x1E01 + 8 * 9, 1);
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.get(device).outputs() == 0));
}

#[test]
fn a_configuration_change_of_a_device_comes_as_a_datagram_and_as_a_device_status_change() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(9, Circuits::Eight));
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    rig.advance_ms(50);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(host).take_interrupt();
    rig.write(host, 0x08B6, 1);
    let pulses = rig.bus.get(host).interrupt_pulses();

    rig.bus.get_mut(device).configure(BlockKind::Inputs, 0x0040);
    rig.advance_ms(20);
    assert_eq!(rig.bus.get(host).interrupt_pulses(), pulses + 2);
    assert_eq!((rig.read(host, 0x08A5), rig.read(host, 0x08A8)), (1, 1));
    assert_eq!(rig.device(host, 9)[3..], [0x40, 0, 1, 0, 0b01]);
    let (header, _) = rig.read_datagram(host).unwrap();
    assert_eq!(header, [9, 0x20, 0x22, 1]);
}

#[test]
fn a_configuration_change_without_new_lengths_is_a_datagram_only() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(9, Circuits::Eight));
    rig.advance_ms(100);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus.get_mut(device).configure(BlockKind::Combination, 0x0040);
    rig.advance_ms(20);
    assert_eq!((rig.read(host, 0x08A5), rig.read(host, 0x08A8)), (0, 1));
}

#[test]
fn a_device_that_outgrows_its_buffer_is_logged_out() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 1)), 4);
    let device = rig.bus.connect(growing_unit());
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    rig.advance_ms(50);
    rig.write_all(host, 0x08A2, &[0; 8]);
    rig.bus
        .get_mut(device)
        .replace_data(StationData { discrete_bytes: 2, channels: 0 }, StationData::default());
    rig.advance_ms(50);
    assert_eq!((rig.device(host, 9)[2], rig.device(host, 9)[5]), (0, 2));
    assert_eq!((rig.read(host, 0x08A5), rig.read(host, 0x08A8)), (1, 1));
}

fn growing_unit() -> BusInterfaceUnit {
    let data = StationData { discrete_bytes: 1, channels: 0 };
    BusInterfaceUnit::new(9, BusTiming::default(), data, StationData::default())
}

#[test]
fn a_log_in_enables_the_outputs_again_when_the_board_started_with_them_enabled() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(9, Circuits::Eight));
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    rig.write(host, 0x1E01 + 8 * 9, 1);
    rig.bus.inject(Fault::Disconnect { device: device.id(), for_us: 100_000 });
    rig.wait_for(host, 0x1E02 + 8 * 9, 0);
    assert_eq!(rig.device(host, 9)[1], 1);
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    assert_eq!(rig.device(host, 9)[1], 0);
}

#[test]
fn a_lost_read_id_is_asked_again() {
    let (mut rig, [host]) = Rig::started([31]);
    let device = rig.bus.connect(block(9, Circuits::Eight));
    rig.bus.inject(Fault::Deafen { device: device.id(), messages: 3 });
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
}

#[test]
fn a_lost_read_id_reply_is_asked_for_again() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.bus.connect(block(9, Circuits::Eight));
    let reply = rig.bus.traffic().background + 2;
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.traffic().background == reply));
    rig.bus.inject(Fault::Damage { messages: 1 });
    rig.advance_ms(20);
    assert_eq!(rig.device(host, 9)[2], 0);
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
}

#[test]
fn the_boards_own_entry_is_not_used() {
    let (mut rig, [host, _]) = Rig::started([30, 31]);
    assert_eq!(rig.device(host, 30), [0; 8]);
}

#[test]
fn there_is_room_for_32_devices() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    for number in 0..31 {
        rig.bus.connect(block(number, Circuits::Eight));
    }
    rig.bus.advance_to(10 * SECOND_US);
    for number in 0..31 {
        assert_eq!(rig.device(host, number)[2], 1, "{number}");
    }
    // Nobody is there to answer at the board's own bus address.
    assert_eq!(rig.transmit(host, 31, [0x20, 0x13], 0, &[]), PROCESS_ERROR);
}

#[test]
fn inputs_of_a_device_that_is_not_logged_in_stay_out_of_the_table() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 2)), 4);
    rig.advance_ms(1_600);
    let device = rig.bus.connect(block(7, Circuits::ThirtyTwo));
    rig.bus.get_mut(device).set_inputs(0x5A5A_5A5A);
    rig.advance_ms(500);
    assert_eq!(rig.device(host, 7)[2], 0);
    assert_eq!(rig.read_array(host, 0x2000 + 2 * 7), [0; 4]);
}

#[test]
fn outputs_go_to_devices_that_are_logged_in_and_to_nobody_else() {
    let (mut rig, [host]) = Rig::started([31]);
    let filler = StationData { discrete_bytes: 100, channels: 0 };
    // There is enough traffic that the shortest scan does not hide anything.
    rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), filler, filler));
    rig.write_all(host, 0x3000 + 128 * 9, &[0xFF; 64]);
    rig.advance_ms(500);
    let absent_ns = rig.bus.scan_time_ns();
    let outputs = StationData { discrete_bytes: 64, channels: 0 };
    let device = rig.bus.connect(BusInterfaceUnit::new(9, BusTiming::default(), outputs, outputs));
    rig.wait_for(host, 0x1E02 + 8 * 9, 1);
    rig.advance_ms(200);
    assert_eq!(rig.bus.get(device).outputs(), [0xFF; 64]);

    rig.bus.inject(Fault::Disconnect { device: device.id(), for_us: 10 * SECOND_US });
    rig.wait_for(host, 0x1E02 + 8 * 9, 0);
    rig.advance_ms(200);
    assert_eq!(rig.bus.scan_time_ns(), absent_ns, "nothing is sent to it any more");
}

#[test]
fn in_the_device_table_only_the_outputs_flag_is_the_hosts() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.write(host, 0x1E01 + 8 * 9, 1);
    rig.assert_lawful(&[host]);
    for byte in [0, 2, 3, 4, 5, 6, 7] {
        rig.write(host, 0x1E00 + 8 * 9 + byte, 0);
    }
    let violations = rig.bus.get(host).violations();
    assert_eq!(violations.len(), 7);
    assert!(violations.iter().all(|violation| violation.kind == ViolationKind::ReadOnly));
}
