//! The bus: published scan times, turns in order of bus addresses, one datagram per scan.

use std::thread;

use super::rig::{Rig, SECOND_US};
use crate::genius::{
    Board, BoardOptions, Bus, BusInterfaceUnit, BusTiming, Device, MIN_SCAN_NS, Message,
    StationData,
};

/// Published contributions in hundredths of a millisecond: rate, bytes, time.
const PUBLISHED: [(BusTiming, usize, u64); 20] = [
    (BusTiming::K153Standard, 16, 209),
    (BusTiming::K153Standard, 32, 324),
    (BusTiming::K153Standard, 64, 552),
    (BusTiming::K153Standard, 128, 1010),
    (BusTiming::K153Standard, 256, 1925),
    (BusTiming::K153Extended, 16, 216),
    (BusTiming::K153Extended, 32, 331),
    (BusTiming::K153Extended, 64, 560),
    (BusTiming::K153Extended, 128, 1017),
    (BusTiming::K153Extended, 256, 1932),
    (BusTiming::K76, 16, 383),
    (BusTiming::K76, 32, 612),
    (BusTiming::K76, 64, 1069),
    (BusTiming::K76, 128, 1985),
    (BusTiming::K76, 256, 3815),
    (BusTiming::K38, 16, 716),
    (BusTiming::K38, 32, 1174),
    (BusTiming::K38, 64, 2089),
    (BusTiming::K38, 128, 3920),
    (BusTiming::K38, 256, 7580),
];

#[test]
fn a_station_adds_its_published_time_to_the_scan() {
    for (rate, bytes, hundredths) in PUBLISHED {
        let mut bus = Bus::new(rate);
        bus.connect(Board::powered(BoardOptions::at(31).rate(rate)));
        // There is enough traffic that the shortest scan does not hide anything.
        let data = StationData { discrete_bytes: 64, channels: 0 };
        bus.connect(BusInterfaceUnit::new(1, rate, data, data));
        bus.advance_to(5 * SECOND_US);
        let without_ns = bus.scan_time_ns().unwrap();
        let half = StationData { discrete_bytes: bytes / 2, channels: 0 };
        bus.connect(BusInterfaceUnit::new(2, rate, half, half));
        bus.advance_by(5 * SECOND_US);
        // The values of the tables are rounded, not always in the same way. The address was skipped
        // before.
        let added_ns = bus.scan_time_ns().unwrap() - without_ns + rate.skip_ns();
        assert!(
            added_ns.abs_diff(hundredths * 10_000) <= 10_000,
            "{rate:?} {bytes}: {added_ns} ns"
        );
        assert_eq!(added_ns, rate.contribution_ns(bytes));
    }
}

#[test]
fn no_scan_is_shorter_than_3_ms() {
    let (rig, _) = Rig::started([31]);
    assert_eq!(rig.bus.scan_time_ns(), Some(MIN_SCAN_NS));
}

/// A device that notes whose turns it hears.
struct Listener {
    turns: Vec<u8>,
}

impl Device for Listener {
    fn address(&self) -> Option<u8> {
        Some(0)
    }
    fn rate(&self) -> BusTiming {
        BusTiming::default()
    }
    fn next_due_us(&self) -> Option<u64> {
        None
    }
    fn advance_to(&mut self, _now_us: u64) {}
    fn take_turn(&mut self, _now_us: u64, _background_free: bool) -> Vec<Message> {
        vec![Message::Control(Vec::new())]
    }
    fn end_turn(&mut self, _now_us: u64, _messages: &[Message], _arrived: &[bool]) {
        self.turns.push(0);
    }
    fn receive(&mut self, _now_us: u64, from: u8, message: &Message) -> bool {
        if matches!(message, Message::Control(_)) {
            self.turns.push(from);
        }
        false
    }
}

#[test]
fn turns_go_in_the_order_of_device_numbers_whatever_the_order_of_connection() {
    let mut bus = Bus::new(BusTiming::default());
    let data = StationData { discrete_bytes: 1, channels: 0 };
    for number in [17, 3, 31, 8] {
        bus.connect(BusInterfaceUnit::new(number, BusTiming::default(), data, data));
    }
    let listener = bus.connect(Listener { turns: Vec::new() });
    bus.advance_to(100_000);
    let turns = &bus.get(listener).turns;
    let start = turns.iter().position(|&number| number == 0).unwrap();
    for scan in turns[start..].chunks_exact(5) {
        assert_eq!(scan, [0, 3, 8, 17, 31]);
    }
}

#[test]
fn the_model_says_when_something_happens_next_and_time_can_be_cut_anywhere() {
    let run = |step_us: u64| {
        let mut rig = Rig::new();
        let hosts = rig.connect([30, 31]);
        while rig.bus.now_us() < 5 * SECOND_US {
            rig.bus.advance_by(step_us);
            if rig.bus.now_us().is_multiple_of(1_000_000) && rig.bus.now_us() >= 2 * SECOND_US {
                rig.write(hosts[0], 0x0893, 0);
            }
        }
        let rams: Vec<_> = hosts.into_iter().map(|host| *rig.bus.get(host).ram()).collect();
        (rams, rig.bus.traffic())
    };
    let whole = run(1_000_000);
    for step_us in [100, 1_000, 50_000] {
        assert!(run(step_us) == whole, "{step_us}");
    }
}

#[test]
fn an_empty_bus_has_nothing_to_do() {
    let mut bus = Bus::new(BusTiming::default());
    assert_eq!(bus.next_due_us(), None);
    bus.advance_to(SECOND_US);
    assert_eq!((bus.now_us(), bus.scan_time_ns()), (SECOND_US, None));
    assert!(!bus.advance_until(SECOND_US, |_| false));
    assert_eq!(bus.now_us(), 2 * SECOND_US);
}

#[test]
fn a_bus_goes_on_in_another_thread_as_it_does_in_this_one() {
    let started = || {
        let mut bus = Bus::new(BusTiming::default());
        for number in [30, 31] {
            bus.connect(Board::powered(BoardOptions::at(number)));
        }
        bus.advance_to(2 * SECOND_US);
        bus
    };
    let goes_on = |mut bus: Bus| {
        bus.advance_to(10 * SECOND_US);
        (bus.traffic(), bus.scan_time_ns())
    };
    let (here, there) = (started(), started());
    let there = thread::spawn(move || goes_on(there)).join().expect("the bus is well");
    assert_eq!(goes_on(here), there);
    assert!(there.1.is_some(), "the bus is up");
}

#[test]
fn a_scan_is_the_sum_of_turns_and_of_a_bit_time_for_every_number_that_is_not_in_use() {
    for (rate, bit_ns) in [
        (BusTiming::K153Standard, 6_510),
        (BusTiming::K153Extended, 2 * 6_510),
        (BusTiming::K76, 13_021),
        (BusTiming::K38, 26_042),
    ] {
        let mut bus = Bus::new(rate);
        bus.connect(Board::powered(BoardOptions::at(31).rate(rate)));
        let data = StationData { discrete_bytes: 64, channels: 0 };
        for number in [1, 7] {
            bus.connect(BusInterfaceUnit::new(number, rate, data, data));
        }
        bus.advance_to(10 * SECOND_US);
        let turns_ns = 2 * rate.contribution_ns(128) + rate.contribution_ns(0);
        assert_eq!(bus.scan_time_ns(), Some(turns_ns + 29 * bit_ns), "{rate:?}");
    }
}
