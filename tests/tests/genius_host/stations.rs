//! Devices on the bus that are no recorders.

use ser_proto::Model;
use ser_proto::genius::ForceTable;
use ser_sim::genius::{BusInterfaceUnit, BusRate, Side, StationData};

use super::desk::Desk;

/// Number of the station.
const STATION: u8 = 9;

#[test]
fn a_force_table_of_128_bytes_is_read() {
    let desk = Desk::new(&[(5, Model::Ser320)]);
    desk.with(|bench| {
        let data = StationData { discrete_bytes: 128, channels: 0 };
        let station = BusInterfaceUnit::new(STATION, BusRate::default(), data, StationData::default());
        let mut bus = bench.world.bus.borrow_mut();
        let station = bus.connect(station);
        bus.get_mut(station).force_point(Side::Inputs, 8 * 128 - 1, Some(true));
    });
    let host = desk.host();
    let forces = host.read_forces(STATION, ForceTable::InputEnable).expect("a reply");
    assert_eq!((forces.contents.len(), forces.contents.last()), (128, Some(&0x80)));
}
