//! Chapter 8: input and output tables.

use super::rig::{COMPLETE, Rig, lengths};
use crate::genius::{BlockKind, BusInterfaceUnit, BusTiming, Circuits, DiscreteBlock, StationData};

#[test]
fn inputs_and_outputs_are_in_the_buffers_of_their_devices() {
    let (mut rig, [host]) = Rig::started([31]);
    let rate = BusTiming::default();
    let block =
        rig.bus.connect(DiscreteBlock::new(12, rate, Circuits::Eight, BlockKind::Combination));
    let unit = rig.bus.connect(BusInterfaceUnit::new(
        3,
        rate,
        StationData { discrete_bytes: 0, channels: 4 },
        StationData { discrete_bytes: 0, channels: 2 },
    ));
    rig.bus.get_mut(block).set_inputs(0xA5);
    rig.bus.get_mut(unit).set_inputs(&[1, 2, 3, 4, 5, 6, 7, 8]);
    rig.write(host, 0x3000 + 128 * 12, 0x3C);
    rig.write_all(host, 0x3000 + 128 * 3, &[9, 10, 11, 12, 13]);
    rig.advance_ms(200);
    assert_eq!(rig.read(host, 0x2000 + 128 * 12), 0xA5);
    assert_eq!(rig.read_array(host, 0x2000 + 128 * 3), [1, 2, 3, 4, 5, 6, 7, 8, 0, 0]);
    assert_eq!(rig.bus.get(block).outputs(), 0x3C);
    assert_eq!(rig.bus.get(unit).outputs(), [9, 10, 11, 12]);
}

#[test]
fn shorter_buffers_shorten_the_whole_table() {
    let (mut rig, [host]) = Rig::started([31]);
    assert_eq!(rig.configure(host, lengths(0, 0, 1)), COMPLETE);
    let blocks: Vec<_> = (0..31)
        .map(|number| {
            let block = DiscreteBlock::new(
                number,
                BusTiming::default(),
                Circuits::Eight,
                BlockKind::Combination,
            );
            rig.bus.connect(block)
        })
        .collect();
    for (&block, inputs) in blocks.iter().zip(100..) {
        rig.bus.get_mut(block).set_inputs(inputs);
    }
    let outputs: Vec<u8> = (200..231).collect();
    rig.write_all(host, 0x2020, &outputs);
    rig.advance_ms(6_000);
    let inputs: [u8; 31] = rig.read_array(host, 0x2000);
    assert!(inputs.into_iter().eq(100..131));
    assert!(blocks.iter().map(|&block| rig.bus.get(block).outputs()).eq(200..231));
}

#[test]
fn inputs_are_new_in_every_scan() {
    let (mut rig, [host]) = Rig::started([31]);
    let block = DiscreteBlock::new(2, BusTiming::default(), Circuits::Eight, BlockKind::Inputs);
    let block = rig.bus.connect(block);
    rig.advance_ms(100);
    for inputs in 0..50 {
        rig.bus.get_mut(block).set_inputs(inputs);
        rig.advance_ms(7);
        assert_eq!(u32::from(rig.read(host, 0x2000 + 128 * 2)), inputs);
    }
}

#[test]
fn forced_points_are_what_the_controller_sees_and_the_field_gets() {
    let (mut rig, [host]) = Rig::started([31]);
    use crate::genius::Side;
    let data = StationData { discrete_bytes: 1, channels: 1 };
    let unit = rig.bus.connect(BusInterfaceUnit::new(3, BusTiming::default(), data, data));
    rig.bus.get_mut(unit).set_inputs(&[0b0101, 0x11, 0x22]);
    rig.bus.get_mut(unit).force_point(Side::Inputs, 0, Some(false));
    rig.bus.get_mut(unit).force_point(Side::Inputs, 3, Some(true));
    rig.bus.get_mut(unit).force_channel(Side::Inputs, 0, Some(0x1234));
    rig.bus.get_mut(unit).force_point(Side::Outputs, 7, Some(true));
    rig.advance_ms(200);
    assert_eq!(rig.read_array(host, 0x2000 + 128 * 3), [0b1100, 0x34, 0x12]);
    assert_eq!(rig.bus.get(unit).outputs(), [0x80, 0, 0]);
    // Forcing points that do not exist has no effect.
    rig.bus.get_mut(unit).force_point(Side::Inputs, 8, Some(true));
    rig.bus.get_mut(unit).force_channel(Side::Outputs, 1, Some(1));
    rig.bus.get_mut(unit).force_channel(Side::Inputs, 0, None);
    rig.advance_ms(20);
    assert_eq!(rig.read_array(host, 0x2000 + 128 * 3), [0b1100, 0x11, 0x22]);
}

/// The table of device types: bytes of inputs and outputs, and the shortest buffer that holds them.
const DEVICE_TYPES: [(&str, usize, usize, u8); 7] = [
    ("8 circuits", 1, 1, 1),
    ("16 circuits", 2, 2, 2),
    ("32 circuits", 4, 4, 4),
    ("4 analog inputs, 2 outputs", 8, 4, 8),
    ("6 analog inputs", 12, 0, 12),
    ("high-speed counter", 30, 32, 32),
    ("power monitor", 38, 2, 38),
];

#[test]
fn every_type_of_device_has_its_shortest_buffer() {
    for (name, inputs, outputs, shortest) in DEVICE_TYPES {
        for buffer in [shortest, shortest - 1].into_iter().filter(|&buffer| buffer > 0) {
            let (mut rig, [host]) = Rig::started([31]);
            assert_eq!(rig.configure(host, lengths(0, 0, buffer)), COMPLETE);
            let data = |discrete_bytes| StationData { discrete_bytes, channels: 0 };
            rig.bus.connect(BusInterfaceUnit::new(
                5,
                BusTiming::default(),
                data(inputs),
                data(outputs),
            ));
            rig.advance_ms(2_000);
            assert_eq!(rig.device(host, 5)[2], u8::from(buffer == shortest), "{name}, {buffer}");
        }
    }
}
