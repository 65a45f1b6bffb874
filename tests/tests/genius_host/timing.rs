//! How exact a clock is after it was set over the bus, and how fresh the inputs are that a host
//! sees.

use ser_client::GeniHost;
use ser_proto::genius::GlobalData;
use ser_proto::{Command, Inputs, LastBroadcast, Model, Reply, TimeStamp};

use crate::desk::{Desk, unit};

/// Enough rounds to meet every phase of a scan.
const ROUNDS: u16 = 60;

/// `count` recorders of the larger model.
fn crowd(count: u8) -> Vec<(u8, Model)> {
    (1..=count).map(|number| (number, Model::Ser320)).collect()
}

/// What a host sees of a recorder's inputs.
fn seen(host: &GeniHost, number: u8) -> Inputs {
    let devices = host.devices().expect("the board is well");
    let device = devices.iter().find(|device| device.number == number).expect("the recorder");
    GlobalData::parse(&device.inputs).expect("a recorder's inputs").state
}

#[test]
fn a_host_sees_a_contact_within_four_scans() {
    for units in [crowd(3), crowd(12)] {
        let desk = Desk::new(&units);
        let host = desk.host();
        // Once everybody is known, nobody is waited for.
        host.devices().expect("the board is well");
        let mut longest_ms = 0;
        // The contact moves at every phase of the scan, at the first and at the last recorder in
        // it.
        for round in 0..u64::from(ROUNDS) {
            for index in [0, units.len() - 1] {
                desk.run(round % 19);
                let on = round % 2 == 0;
                let moved_ms = desk.contact(index, on);
                let number = units[index].0;
                while seen(&host, number) != Inputs(u32::from(on)) {
                    assert!(desk.now_ms() < moved_ms + 1_000, "recorder {number} shows nothing");
                }
                longest_ms = longest_ms.max(desk.now_ms() - moved_ms);
            }
        }
        let scan_ms = desk.with(|bench| bench.scan_ms());
        assert!(longest_ms <= 4 * scan_ms, "{longest_ms} ms at a scan of {scan_ms} ms");
    }
}

#[test]
fn a_clock_that_was_set_over_a_quiet_bus_is_off_by_little_more_than_half_a_scan() {
    for count in [1, 12] {
        let desk = Desk::new(&crowd(count));
        let host = desk.host();
        let mut unit = unit(&host, 1);
        let scan_ms = desk.with(|bench| bench.scan_ms());
        let mut off_ms = Vec::new();
        for round in 0..u64::from(ROUNDS) {
            // The clock is set at every phase of the scan, never in a scan that has had its
            // datagram.
            desk.run(3 * scan_ms + round % (scan_ms + 1));
            unit.set_clock(|ahead| {
                at(desk.now_ms() + u64::try_from(ahead.as_millis()).expect("short"))
            })
            .expect("the clock is set");
            let moved_ms = desk.contact(0, round % 2 == 0);
            desk.run(2);
            let entry = u16::try_from(round + 1).expect("few");
            off_ms.push(stamp_ms(&host, 1, entry) - ms(at(moved_ms)));
        }
        let limit_ms = half_and_some(scan_ms);
        let (most, count) = (off_ms.iter().map(|off| off.abs()).max(), i64::from(ROUNDS));
        assert!(most <= Some(limit_ms), "{limit_ms} ms at most: {off_ms:?}");
        assert!(off_ms.iter().sum::<i64>().abs() <= count, "neither ahead nor behind: {off_ms:?}");
    }
}

#[test]
fn a_broadcast_sets_all_clocks_alike_at_every_phase_of_the_scan() {
    const COUNT: u8 = 12;
    let desk = Desk::new(&crowd(COUNT));
    let host = desk.host();
    let scan_ms = desk.with(|bench| bench.scan_ms());
    for round in 0..2 * scan_ms {
        desk.run(3 * scan_ms + round % (scan_ms + 1));
        let began_ms = desk.now_ms();
        let set = at(began_ms + u64::try_from(host.delay().as_millis()).expect("short"));
        host.broadcast(&Command::SetClock(set)).expect("it is on the bus");
        let waited_ms = desk.now_ms() - began_ms;
        assert!(
            waited_ms <= scan_ms + 3,
            "it went out after {waited_ms} ms at a scan of {scan_ms} ms"
        );
        desk.run(5);
        let on = round % 2 == 0;
        let moved_ms = (0..COUNT).map(|index| desk.contact(index.into(), on)).max().expect("some");
        desk.run(2);
        let entry = u16::try_from(round + 1).expect("few");
        let off_ms: Vec<_> =
            (1..=COUNT).map(|number| stamp_ms(&host, number, entry) - ms(at(moved_ms))).collect();
        let (least, most) =
            (off_ms.iter().min().expect("some"), off_ms.iter().max().expect("some"));
        assert!(most - least <= 1, "{off_ms:?}");
        let limit_ms = half_and_some(scan_ms);
        assert!(-limit_ms <= *least && *most <= limit_ms, "{limit_ms} ms at most: {off_ms:?}");
    }
}

#[test]
fn a_mark_compares_clocks_and_comes_between_the_two_times_that_the_host_tells() {
    const COUNT: u8 = 12;
    let desk = Desk::new(&crowd(COUNT));
    let host = desk.host();
    let scan_ms = desk.with(|bench| bench.scan_ms());
    // Each clock shows something else.
    for number in 1..=COUNT {
        let ahead_ms = u64::from(number) * 777;
        unit(&host, number).set_clock(|_| at(desk.now_ms() + ahead_ms)).expect("the clock is set");
    }
    let now_ms = || i64::try_from(host.now().as_millis()).expect("short");
    for round in 0..2 * scan_ms {
        desk.run(3 * scan_ms + round % (scan_ms + 1));
        let began_ms = now_ms();
        host.broadcast(&Command::Read { start: 1, count: 1 }).expect("it is on the bus");
        let mut came_ms = Vec::new();
        for number in 1..=COUNT {
            let mut unit = unit(&host, number);
            let last = unit.last_broadcast().expect("a reply").expect("a broadcast");
            assert_eq!(last.code, b'R');
            let (_, to) = unit.last_exchange().expect("a reply").carried_out();
            // A change says how far the clock is ahead.
            let on = round % 2 == 0;
            let moved_ms = desk.contact(usize::from(number) - 1, on);
            desk.run(2);
            let entry = u16::try_from(round + 1).expect("few");
            let ahead_ms = stamp_ms(&host, number, entry) - ms(at(moved_ms));
            let LastBroadcast { hour, minute, second, millisecond, .. } = last;
            let showed = TimeStamp { hour, minute, second, millisecond, ..at(0) };
            let came = ms(showed) - ahead_ms;
            let to_ms = i64::try_from(to.as_millis()).expect("short");
            assert!((began_ms - 1..=to_ms + 1).contains(&came), "{began_ms} {came} {to_ms}");
            came_ms.push(came);
        }
        let (least, most) = (came_ms.iter().min().expect("12"), came_ms.iter().max().expect("12"));
        assert!(most - least <= 1, "one instant: {came_ms:?}");
    }
}

/// How far a clock may be off, because nobody knows how long the datagram waits for the host's
/// turn.
fn half_and_some(scan_ms: u64) -> i64 {
    i64::try_from(scan_ms / 2).expect("short") + 3
}

/// The time that a recorder gives for an entry.
fn stamp_ms(host: &GeniHost, number: u8, entry: u16) -> i64 {
    let reply =
        unit(host, number).request(&Command::Read { start: entry, count: 1 }).expect("a reply");
    let Reply::Read(reply) = reply else { panic!("{reply:?}") };
    ms(reply.entries[0].time)
}

/// What all clocks show at a moment.
fn at(now_ms: u64) -> TimeStamp {
    let part = |unit_ms: u64, of: u64| u8::try_from(now_ms / unit_ms % of).expect("small");
    TimeStamp {
        year: 26,
        month: 11,
        day: 22,
        hour: part(3_600_000, 24),
        minute: part(60_000, 60),
        second: part(1000, 60),
        millisecond: u16::try_from(now_ms % 1000).expect("small"),
    }
}

fn ms(time: TimeStamp) -> i64 {
    ((i64::from(time.hour) * 60 + i64::from(time.minute)) * 60 + i64::from(time.second)) * 1000
        + i64::from(time.millisecond)
}
