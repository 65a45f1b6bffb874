//! Chapter 3, start-up and steady state; chapter 2, reset; chapter 14, lamps.

use super::rig::{Rig, SECOND_US};
use crate::genius::{
    BlockKind, Board, BoardOptions, BusTiming, Circuits, DeviceFault, DiscreteBlock, Fault, Led,
    Leds, ViolationKind,
};

#[test]
fn the_host_waits_1_7_seconds_then_for_the_ok_flag_and_has_1_5_seconds_before_the_bus() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(1_700_000);
    assert_eq!(rig.read(host, 0x0893), 0);
    rig.wait_for(host, 0x0893, 1);
    let ok_us = rig.bus.now_us();
    assert!((1_700_000..=2_000_000).contains(&ok_us), "{ok_us}");
    let on_bus = rig.bus.advance_until(2 * SECOND_US, |bus| bus.get(host).is_on_bus());
    assert!(on_bus);
    assert_eq!(rig.bus.now_us(), ok_us + 1_500_000);
    rig.assert_lawful(&[host]);
}

#[test]
fn after_the_self_test_the_shared_ram_holds_the_defaults() {
    let mut rig = Rig::new();
    let [host] = rig.connect([29]);
    rig.bus.advance_to(2 * SECOND_US);
    assert_eq!(rig.read(host, 0x0882), 0xE0 | 29, "switches");
    assert_eq!(rig.read_word(host, 0x0883), 0xFFFF, "reference address");
    assert_eq!(rig.read_array(host, 0x0885), [0, 0, 128], "lengths");
    assert_eq!(rig.read_array(host, 0x08A2), [0; 32], "interrupt tables");
    assert_eq!(rig.read_array(host, 0x0A48), [0; 2], "lockout");
    assert_eq!(rig.read(host, 0x08C2), 4, "command status");
    assert_eq!(rig.read_array(host, 0x0880), [0, 0], "request queue");
    assert_eq!(rig.read_array(host, 0x0894), [0, 0, 0, 0], "no faults, no monitor, no bus errors");
    for number in 0..32 {
        assert_eq!(rig.device(host, number)[1..3], [0, 0], "outputs enabled, not present");
    }
    // An empty receive queue shows in the only way it can.
    assert_eq!(rig.read_datagram(host), None);
}

#[test]
fn with_switch_8_at_0_all_outputs_start_disabled() {
    let mut rig = Rig::new();
    let options = BoardOptions::at(31).outputs_disabled();
    let host = rig.bus.connect(Board::powered(options));
    rig.bus.advance_to(2 * SECOND_US);
    for number in 0..32 {
        assert_eq!(rig.device(host, number)[1], 1);
    }
}

#[test]
fn the_ram_is_of_no_use_before_that_and_an_access_is_noticed() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(1_000_000);
    rig.write(host, 0x0885, 2);
    assert_ne!(rig.read(host, 0x0893), 1);
    let kinds: Vec<_> =
        rig.bus.get(host).violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(kinds, [ViolationKind::TooEarly; 2]);
    rig.bus.advance_to(2 * SECOND_US);
    assert_eq!(rig.read(host, 0x0885), 0, "what was written is gone");
}

#[test]
fn an_access_right_after_reset_can_stop_the_board() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.advance_to(400);
    rig.read(host, 0x0893);
    rig.bus.advance_to(5 * SECOND_US);
    assert_ne!(rig.read(host, 0x0893), 1);
    assert!(!rig.bus.get(host).is_on_bus());
}

#[test]
fn one_false_interrupt_comes_right_after_reset() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    assert!(!rig.bus.get_mut(host).take_interrupt());
    rig.bus.advance_to(500);
    assert!(rig.bus.get_mut(host).take_interrupt());
    rig.bus.advance_to(2 * SECOND_US);
    assert!(!rig.bus.get_mut(host).take_interrupt());
}

#[test]
fn a_failed_self_test_shows_in_the_status_table_and_the_ok_flag_never_comes() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    rig.bus.inject(Fault::Inside { device: host.id(), fault: DeviceFault::FailNextStart(0x02) });
    rig.bus.advance_to(5 * SECOND_US);
    assert_eq!(rig.read_array(host, 0x0893), [0, 0x02]);
    assert!(!rig.bus.get(host).is_on_bus());
    assert_eq!(rig.bus.get(host).leds(), Leds { board_ok: Led::Off, comm_ok: Led::Off });
}

#[test]
fn a_reset_starts_everything_again() {
    let (mut rig, [host, other]) = Rig::started([30, 31]);
    rig.write(host, 0x1F80, 7);
    rig.bus.get_mut(host).hold_reset();
    rig.advance_ms(20);
    assert!(!rig.bus.get(host).is_on_bus());
    rig.bus.get_mut(host).release_reset();
    rig.advance_ms(1_700);
    rig.wait_for(host, 0x0893, 1);
    assert_eq!(rig.read(host, 0x1F80), 0);
    assert_eq!(rig.device(other, 30)[2], 0, "the other board has logged it out");
    rig.wait_for(other, 0x1E02 + 8 * 30, 1);
}

#[test]
fn the_lamps_follow_board_and_bus() {
    let mut rig = Rig::new();
    let host = rig.bus.connect(Board::new(BoardOptions::at(31)));
    rig.bus.advance_to(SECOND_US);
    let lamps = |rig: &Rig| {
        let Leds { board_ok, comm_ok } = rig.bus.get(host).leds();
        [board_ok, comm_ok]
    };
    assert_eq!(lamps(&rig), [Led::Off, Led::Off]);
    rig.bus.get_mut(host).release_reset();
    rig.advance_ms(2_000);
    assert_eq!(lamps(&rig), [Led::On, Led::Off]);
    rig.advance_ms(2_000);
    assert_eq!(lamps(&rig), [Led::On, Led::On]);
}

#[test]
fn nothing_is_taken_from_the_bus_before_the_board_is_on_it() {
    let mut rig = Rig::new();
    let [host] = rig.connect([31]);
    let block =
        DiscreteBlock::new(4, BusTiming::default(), Circuits::Eight, BlockKind::Combination);
    let block = rig.bus.connect(block);
    rig.bus.get_mut(block).set_inputs(0xA5);
    rig.bus.advance_to(2 * SECOND_US);
    rig.write(host, 0x3000 + 128 * 4, 0x3C);
    rig.bus.advance_to(3 * SECOND_US);
    assert_eq!((rig.device(host, 4)[2], rig.read(host, 0x2000 + 128 * 4)), (0, 0));
    assert_eq!(rig.bus.get(block).outputs(), 0);
    rig.bus.advance_to(4 * SECOND_US);
    assert_eq!((rig.device(host, 4)[2], rig.read(host, 0x2000 + 128 * 4)), (1, 0xA5));
    assert_eq!(rig.bus.get(block).outputs(), 0x3C);
}

#[test]
fn the_reserved_area_is_not_the_hosts() {
    let (mut rig, [host]) = Rig::started([31]);
    rig.read(host, 0x0A49);
    rig.read(host, 0x1E00);
    rig.assert_lawful(&[host]);
    rig.read(host, 0x0A4A);
    rig.write(host, 0x1DFF, 1);
    let violations = rig.bus.get(host).violations();
    let seen: Vec<_> =
        violations.iter().map(|violation| (violation.kind, violation.offset)).collect();
    assert_eq!(
        seen,
        [(ViolationKind::ReservedArea, 0x0A4A), (ViolationKind::ReservedArea, 0x1DFF)]
    );
}
