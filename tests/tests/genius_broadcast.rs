//! Many recorders on one bus: one broadcast sets all clocks, and all inputs are seen in every scan.

use geni_board::CommandError;
use geni_board::Destination::Broadcast;
use ser_proto::{Code, Command, Model, Reply, TimeStamp};
use ser_trial::genius_world::World;

const NOON: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 0 };

/// How far clocks may differ. A broadcast reaches all boards at once, but every recorder fetches it
/// from its board by itself: the board says so and carries out Read Datagram, and the recorder
/// looks once per millisecond.
const CLOCKS_AGREE_WITHIN_MS: u32 = 1;

fn milliseconds(time: TimeStamp) -> u32 {
    ((u32::from(time.hour) * 60 + u32::from(time.minute)) * 60 + u32::from(time.second)) * 1000
        + u32::from(time.millisecond)
}

/// How many phases of the bus scan the same edge is seen in.
const EDGES: u16 = 12;

#[test]
fn one_broadcast_sets_the_clocks_of_30_recorders() {
    let units: Vec<(u8, Model)> = (1..=30)
        .map(|number| (number, if number % 2 == 0 { Model::Ser160 } else { Model::Ser320 }))
        .collect();
    let mut world = World::started(&units);
    // A board that still has to assign itself to 30 others has no memory for its host's datagrams,
    // and says so.
    let sent_ms = loop {
        world.host.sent.clear();
        world.send(Broadcast, &Command::SetClock(NOON));
        let sent_ms = world.now_ms;
        match world.until("the broadcast is out", |world| world.host.sent.pop_front()) {
            Ok(()) => break sent_ms,
            Err(error) => assert_eq!(error, CommandError::Failed),
        }
        world.run(1_000);
    };
    // The host's turn has ended and all boards have the datagram. The bus adds no more than the
    // wait for the host's turn.
    let out_ms = world.now_ms;
    let scan_ns = world.bus.borrow().scan_time_ns().expect("a running bus");
    assert!(out_ms - sent_ms <= 3 * scan_ns.div_ceil(1_000_000));
    world.run(20);

    for (number, _) in &units {
        let Reply::LastBroadcast(Some(last)) = world.ask(*number, &Command::LastBroadcast) else {
            panic!()
        };
        assert_eq!((last.code, last.hour, last.minute), (Code::SetClock.byte(), 12, 0));
        assert_eq!((last.second, last.millisecond), (0, 0));
    }
    // The same edge occurs at all of them repeatedly. No time between two edges is a multiple of a
    // scan.
    let mut edges_ms = Vec::new();
    for edge in 0..EDGES {
        world.run(7 + 5 * u64::from(edge));
        for recorder in &mut world.recorders {
            recorder.contact(3, edge % 2 == 0);
        }
        world.step();
        edges_ms.push(world.now_ms);
    }
    for (entry, edge_ms) in (1..).zip(edges_ms) {
        let mut stamp = |number| {
            let read = Command::Read { start: entry, count: 1 };
            let Reply::Read(reply) = world.ask(number, &read) else { panic!() };
            milliseconds(reply.entries[0].time)
        };
        let stamps: Vec<_> = units.iter().map(|(number, _)| stamp(*number)).collect();
        let (earliest, latest) =
            (stamps.iter().min().expect("30"), stamps.iter().max().expect("30"));
        assert!(latest - earliest <= CLOCKS_AGREE_WITHIN_MS, "{stamps:?}");
        // The clocks are behind a clock set when the datagram had left. The difference is the time
        // that the boards take.
        let elapsed = u32::try_from(edge_ms - out_ms).expect("short");
        let behind = elapsed + milliseconds(NOON) - earliest;
        assert!(behind <= 5, "{behind} ms");
        println!("30 clocks within {} ms of each other, {behind} ms behind", latest - earliest);
    }
    world.assert_lawful();
}

#[test]
fn inputs_are_seen_in_every_scan_also_while_recording_is_stopped() {
    let units = [(3, Model::Ser160), (9, Model::Ser320), (17, Model::Ser160)];
    let mut world = World::started(&units);
    world.send(Broadcast, &Command::SetMode { recording: false });
    world.run(50);
    let mut state = 0;
    for round in 0..20_u8 {
        let (input, on) = (1 + round % 15, round % 3 != 0);
        for recorder in &mut world.recorders {
            recorder.contact(input, on);
            recorder.contact(16, round % 2 == 0);
        }
        let bit = 1_u32 << (input - 1);
        state = if on { state | bit } else { state & !bit };
        state = if round % 2 == 0 { state | 0x8000 } else { state & !0x8000 };
        // This covers the next lockout, the next turn, and the host's own exchange of tables.
        world.run(40);
        for (number, model) in units {
            let len = if model == Model::Ser160 { 2 } else { 4 };
            assert_eq!(
                world.global(number, len),
                state.to_le_bytes()[..len],
                "recorder {number}, round {round}"
            );
        }
    }
    world.assert_lawful();
}
