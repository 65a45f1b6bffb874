//! Faults happen in the same way every time, and the boards show what the manual says.

use super::rig::{COMPLETE, PROCESS_ERROR, Rig, SECOND_US, lengths};
use crate::genius::{
    BlockKind, Board, BoardOptions, BusTiming, Circuits, DeviceFault, DiscreteBlock, Fault, Led,
    Noise,
};

#[test]
fn noise_is_the_same_for_the_same_seed_and_counts_as_bus_errors() {
    let run = |seed| {
        let noise = Noise { seed, damaged_ppm: 2_000, lost_ppm: 3_000, unacknowledged_ppm: 0 };
        let mut rig = Rig::with_noise(noise);
        let hosts = rig.connect([29, 30, 31]);
        rig.bus.advance_to(60 * SECOND_US);
        let errors = hosts.map(|host| rig.read_word(host, 0x0896));
        (errors, rig.bus.traffic())
    };
    let (errors, traffic) = run(7);
    assert_eq!((errors, traffic), run(7));
    assert_ne!((errors, traffic), run(8));
    let others = 2 * traffic.damaged + traffic.lost;
    // Errors before a board is up are not counted.
    let counted: u64 = errors.into_iter().map(u64::from).sum();
    assert!(counted <= others && counted > others / 2, "{counted} of {others}");
}

#[test]
fn a_damaged_message_is_an_error_to_everyone_and_arrives_nowhere() {
    let (mut rig, [a, b, c]) = Rig::started([29, 30, 31]);
    rig.start_transmit(a, 31, [0x40, 0x50], 1, &[1]);
    let sent = rig.bus.traffic().background + 1;
    assert!(rig.bus.advance_until(SECOND_US, |bus| bus.traffic().background == sent));
    rig.bus.inject(Fault::Damage { messages: 1 });
    assert_eq!(rig.complete_command(a), PROCESS_ERROR);
    let errors = [a, b, c].map(|host| rig.read_word(host, 0x0896));
    assert_eq!(errors, [0, 1, 1]);
    assert_eq!(rig.read_datagram(c), None);
}

#[test]
fn a_missing_acknowledgement_makes_the_sender_send_twice() {
    let noise = Noise { unacknowledged_ppm: 1_000_000, ..Noise::default() };
    let mut rig = Rig::with_noise(noise);
    let [a, b] = rig.connect([30, 31]);
    rig.bus.advance_to(5 * SECOND_US);
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), PROCESS_ERROR);
    assert!(rig.read_datagram(b).is_some());
}

#[test]
fn two_boards_that_start_with_the_same_number_find_out_and_blink() {
    let mut rig = Rig::new();
    let [a, b, c] = rig.connect([30, 30, 31]);
    rig.bus.advance_to(6 * SECOND_US);
    for host in [a, b] {
        assert_eq!(rig.bus.get(host).leds().board_ok, Led::Flashing);
        assert_eq!(rig.bus.get(host).leds().comm_ok, Led::Flashing);
        assert_eq!(rig.read_word(host, 0x0898), 0xFFFF);
    }
    assert_ne!(rig.bus.traffic().collisions, 0);
    assert_ne!(rig.read_word(c, 0x0896), 0, "the others hear it as errors");
    assert_eq!(rig.read_word(c, 0x0898), 3);
    // The bus address can be changed on the spot, without a reset.
    rig.bus.get_mut(b).set_switches(0xE0 | 5);
    rig.advance_ms(4_000);
    assert_eq!(rig.read(b, 0x0882), 0xE0 | 5);
    assert_eq!((rig.device(c, 30)[2], rig.device(c, 5)[2]), (1, 1));
}

#[test]
fn a_board_that_finds_its_number_taken_stays_off_until_it_is_free() {
    let (mut rig, [a, c]) = Rig::started([30, 31]);
    let late = rig.bus.connect(Board::powered(BoardOptions::at(30)));
    rig.advance_ms(6_000);
    assert_eq!(rig.bus.get(late).leds().comm_ok, Led::Flashing);
    assert_eq!(rig.bus.traffic().collisions, 0);
    assert!(rig.bus.get(a).is_on_bus());
    rig.bus.get_mut(a).hold_reset();
    rig.advance_ms(4_000);
    assert!(rig.bus.get(late).is_on_bus());
    assert_eq!(rig.device(c, 30)[2], 1);
}

#[test]
fn blocks_with_the_same_number_collide_until_one_is_changed() {
    let (mut rig, [host]) = Rig::started([31]);
    let block = || DiscreteBlock::new(4, BusTiming::default(), Circuits::Eight, BlockKind::Inputs);
    let [one, _] = [block(), block()].map(|block| rig.bus.connect(block));
    rig.advance_ms(500);
    assert_eq!(rig.device(host, 4)[2], 0);
    assert_eq!(rig.read(host, 0x0895), 0x04, "excessive bus errors");
    let fault = DeviceFault::ChangeAddress(6);
    rig.bus.inject(Fault::Inside { device: one.id(), fault });
    rig.advance_ms(500);
    assert_eq!((rig.device(host, 4)[2], rig.device(host, 6)[2]), (1, 1));
}

#[test]
fn a_board_that_resets_by_itself_has_forgotten_its_configuration() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    assert_eq!(rig.configure(a, lengths(4, 0, 128)), COMPLETE);
    rig.advance_ms(3_000);
    let at_us = rig.bus.now_us() + 500_000;
    rig.bus.schedule(at_us, Fault::Inside { device: a.id(), fault: DeviceFault::Reset });
    rig.advance_ms(5_000);
    assert_eq!(rig.read(a, 0x0885), 0);
    assert_eq!(rig.device(b, 30)[5], 0);
}

#[test]
fn a_board_that_answers_late_still_answers() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    let fault = DeviceFault::AnswerLate { by_us: 400_000 };
    rig.bus.inject(Fault::Inside { device: a.id(), fault });
    let before_us = rig.bus.now_us();
    assert_eq!(rig.transmit(a, 31, [0x40, 0x50], 0, &[1]), COMPLETE);
    assert!(rig.bus.now_us() - before_us > 400_000);
    assert!(rig.read_datagram(b).is_some());
}

#[test]
fn a_scheduled_silence_logs_the_device_out_and_in() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    let at_us = rig.bus.now_us() + 100_000;
    rig.bus.schedule(at_us, Fault::Disconnect { device: b.id(), for_us: 50_000 });
    rig.wait_for(a, 0x1E02 + 8 * 31, 0);
    assert!(rig.bus.now_us() >= at_us);
    rig.wait_for(a, 0x1E02 + 8 * 31, 1);
    assert!(rig.bus.now_us() >= at_us + 50_000);
}

#[test]
fn bytes_at_random_do_not_upset_a_board() {
    let (mut rig, [a, b]) = Rig::started([30, 31]);
    let mut numbers = oorandom::Rand64::new(42);
    for _ in 0..50_000 {
        let [low, high, byte, step, ..] = numbers.rand_u64().to_le_bytes();
        let offset = u16::from_le_bytes([low, high]);
        // Most writes are near what the board looks at.
        let offset = if step & 1 == 0 { 0x0880 + offset % 0x60 } else { offset };
        rig.write(a, offset, byte % 17);
        rig.bus.advance_by(u64::from(step) * 10);
    }
    assert!(rig.bus.now_us() > 30 * SECOND_US);
    assert_eq!(rig.read(b, 0x0893), 1);
}
