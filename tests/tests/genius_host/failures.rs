//! What a host is told when board, bus or recorder fail, and how it goes on where it was when they
//! are back.

use std::time::Duration;

use ser_client::{
    Cursor, Delivery, Diagnosis, GeniHost, GeniusError, OpenError, Options, RequestError,
    TransportError, Unit,
};
use ser_proto::genius::ForceTable;
use ser_proto::{Command, Model};
use ser_sim::genius::{DeviceFault, DeviceId, Fault, Noise};

use crate::desk::{Bench, Desk, Stall, unit};

const NODE: u8 = 5;
const EVENTS: u16 = 40;
const SIZE: u16 = 2048;

/// How long a reset board takes until it is back on the bus with everybody logged in.
const RECOVERY_MS: u64 = 10_000;

fn desk() -> Desk {
    Desk::new(&[(NODE, Model::Ser160), (9, Model::Ser320)])
}

/// Makes something happen to a device, this long from now.
fn inject(
    desk: &Desk,
    in_ms: u64,
    device: impl Fn(&Bench) -> DeviceId + Send + 'static,
    fault: impl Fn(DeviceId) -> Fault + Send + 'static,
) {
    desk.with(move |bench| {
        let fault = fault(device(bench));
        let mut bus = bench.world.bus.borrow_mut();
        let at_us = bus.now_us() + in_ms * 1000;
        bus.schedule(at_us, fault);
    });
}

fn host_board(bench: &Bench) -> DeviceId {
    bench.world.host.board.id()
}

fn first_recorder(bench: &Bench) -> DeviceId {
    bench.world.recorders[0].board.id()
}

fn of_genius<T>(result: Result<T, RequestError>) -> GeniusError {
    match result {
        Err(RequestError::Transport(TransportError::Genius(error))) => error,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("an answer"),
    }
}

#[test]
fn a_board_that_is_not_on_the_bus_says_so() {
    let desk = desk();
    inject(&desk, 0, host_board, |device| Fault::Disconnect { device, for_us: 30_000_000 });
    desk.run(5_000);
    match desk.open(desk.window()).err() {
        Some(OpenError::Genius { error: GeniusError::OffBus, .. }) => {}
        other => panic!("{other:?}"),
    }
    desk.run(30_000);
    let host = desk.host();
    assert_eq!(host.devices().expect("all is well").len(), 2);

    // Its cable is pulled again, while a host is at work.
    inject(&desk, 0, host_board, |device| Fault::Disconnect { device, for_us: 30_000_000 });
    desk.run(5_000);
    assert_eq!(host.devices().err(), Some(GeniusError::OffBus));
    assert_eq!(host.find(NODE).err(), Some(GeniusError::OffBus));
    assert_eq!(host.broadcast(&Command::LastBroadcast).err(), Some(GeniusError::OffBus));
    assert_eq!(of_genius(unit(&host, NODE).mode()), GeniusError::OffBus);
    desk.run(30_000);
    unit(&host, NODE).mode().expect("a reply");
}

#[test]
fn numbers_without_a_recorder_are_told_apart() {
    let desk = desk();
    let host = desk.host();
    let forces = |number| host.read_forces(number, ForceTable::InputValues).err();
    for (number, error) in [
        (7, GeniusError::NotOnBus { node: 7 }),
        (200, GeniusError::NotOnBus { node: 200 }),
        (31, GeniusError::OwnNumber { node: 31 }),
    ] {
        assert_eq!(host.find(number).err(), Some(error));
        assert_eq!(of_genius(unit(&host, number).mode()), error);
        assert_eq!(forces(number), Some(error));
    }
}

/// A reading of a log, during which something happens to the recorder.
struct Reading {
    desk: Desk,
    host: GeniHost,
    unit: Unit,
    cursor: Option<Cursor>,
    entries: u16,
}

impl Reading {
    fn new() -> Reading {
        let desk = desk();
        for event in 0..EVENTS {
            desk.contact(0, event % 2 == 0);
            desk.run(2);
        }
        let host = desk.host();
        let unit = unit(&host, NODE);
        Reading { desk, host, unit, cursor: None, entries: 0 }
    }

    /// Reads on. Calls `halfway` once, after the first entries. Every entry comes once and in
    /// order.
    fn read(&mut self, halfway: impl FnOnce(&Desk)) -> Result<(), RequestError> {
        let Reading { desk, unit, cursor, entries, .. } = self;
        let mut halfway = Some(halfway);
        unit.read_new(cursor, SIZE, &mut |delivery| {
            let Delivery::Event { entry, .. } = delivery else { panic!("{delivery:?}") };
            assert_eq!(entry.state.contains(1), *entries % 2 == 0, "entry {entries}");
            *entries += 1;
            if let Some(halfway) = halfway.take() {
                halfway(desk);
            }
        })
        .map(drop)
    }

    /// Reads the rest when all is well again.
    fn finish(mut self) {
        assert!((1..EVENTS).contains(&self.entries), "{} entries", self.entries);
        self.desk.run(RECOVERY_MS);
        self.read(|_| {}).expect("the recorder is back");
        assert_eq!(self.entries, EVENTS);
    }
}

fn diagnosis(result: Result<(), RequestError>) -> Diagnosis {
    match result {
        Err(RequestError::NoReply { diagnosis, .. }) => diagnosis,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_recorder_that_leaves_the_bus_while_it_is_read_is_missed_there() {
    let mut reading = Reading::new();
    let gone = reading.read(|desk| {
        inject(desk, 0, first_recorder, |device| Fault::Disconnect { device, for_us: 6_000_000 });
    });
    assert_eq!(of_genius(gone), GeniusError::NotOnBus { node: NODE });
    reading.finish();
}

#[test]
fn a_recorder_that_does_not_answer_while_it_is_read_is_told_from_one_that_cannot_hear() {
    let mut reading = Reading::new();
    let stuck = reading
        .read(|desk| desk.with(|bench| bench.paused = Some(bench.world.recorders.remove(0))));
    assert_eq!(diagnosis(stuck), Diagnosis::SilentOnBus { node: NODE });
    reading.desk.with(|bench| bench.world.recorders.extend(bench.paused.take()));
    reading.finish();

    let mut reading = Reading::new();
    let deaf = reading.read(|desk| {
        inject(desk, 0, first_recorder, |device| Fault::Deafen { device, messages: 3_000 });
    });
    assert_eq!(diagnosis(deaf), Diagnosis::Unacknowledged { node: NODE });
    assert!(reading.host.find(NODE).is_ok());
    reading.finish();
}

#[test]
fn a_board_that_fails_in_the_middle_of_a_command_is_the_reason_given() {
    let desk = desk();
    let host = desk.host();
    let mut unit = unit(&host, NODE);
    for fault in [DeviceFault::Hang, DeviceFault::FailSelfTest(4), DeviceFault::Reset] {
        let mut failed = 0;
        // Each fault comes a little later in the exchange of command and reply.
        for in_ms in [0, 1, 2, 3, 5, 8, 13] {
            inject(&desk, in_ms, host_board, move |device| Fault::Inside { device, fault });
            let result = unit.mode();
            match (fault, result.map_err(|error| of_genius::<()>(Err(error)))) {
                (DeviceFault::Hang, Err(GeniusError::BoardSilent))
                | (
                    DeviceFault::FailSelfTest(_) | DeviceFault::Reset,
                    Err(GeniusError::BoardFailed(_)),
                ) => {
                    failed += 1;
                }
                // The answer was there before, or the board came back before the patience was over.
                (_, Ok(_)) => {}
                (_, Err(error)) => panic!("{fault:?} after {in_ms} ms: {error}"),
            }
            // Somebody resets the board.
            desk.with(|bench| bench.in_reset = true);
            desk.run(20);
            desk.with(|bench| bench.in_reset = false);
            desk.run(RECOVERY_MS);
            // This takes the error that was found meanwhile, which is reported once.
            let _ = unit.mode();
            unit.mode().unwrap_or_else(|error| panic!("{fault:?} after {in_ms} ms: {error}"));
        }
        assert!(failed >= 5, "{fault:?} was noticed {failed} times");
    }
}

#[test]
fn a_board_may_stand_still_for_as_long_as_the_host_is_patient() {
    const STALL_MS: u64 = 9_000;
    let desk = desk();
    let patience = Duration::from_secs(10);
    let patient = Options { timeout: Duration::from_secs(60), retries: 0 };
    let host =
        desk.open_patiently(desk.window(), patience).unwrap_or_else(|error| panic!("{error}"));
    let mut unit = host.unit(NODE, patient);
    // The stall hits every part of an exchange (a look into the queue, a datagram, its reply) and
    // of a lockout.
    for after_ms in [0, 1, 2, 3, 5, 8, 13] {
        stall(&desk, after_ms, STALL_MS);
        unit.mode().unwrap_or_else(|error| panic!("after {after_ms} ms: {error}"));
        desk.run(STALL_MS + 1_000);
        stall(&desk, after_ms, STALL_MS);
        assert_eq!(host.devices().map(|devices| devices.len()), Ok(2), "after {after_ms} ms");
        desk.run(STALL_MS + 1_000);
    }
    drop((unit, host));

    let host = desk.host();
    stall(&desk, 0, STALL_MS);
    assert_eq!(of_genius(host.unit(NODE, patient).mode()), GeniusError::BoardSilent);
}

/// Makes everything behind the window stand still, this long from now.
fn stall(desk: &Desk, in_ms: u64, for_ms: u64) {
    desk.with(move |bench| bench.stall = Some(Stall { in_ms, for_ms }));
}

#[test]
fn a_noisy_bus_costs_time_and_no_entries() {
    let noise =
        Noise { seed: 1, damaged_ppm: 20_000, lost_ppm: 20_000, unacknowledged_ppm: 20_000 };
    let desk = Desk::with_noise(&[(NODE, Model::Ser160), (9, Model::Ser320)], noise);
    for event in 0..EVENTS {
        desk.contact(0, event % 2 == 0);
        desk.run(2);
    }
    let host = desk.host();
    let unit = unit(&host, NODE);
    let mut reading = Reading { desk, host, unit, cursor: None, entries: 0 };
    let began = reading.desk.with(|bench| bench.world.bus.borrow().traffic());
    reading.read(|_| {}).expect("the log is read");
    assert_eq!(reading.entries, EVENTS);
    let ended = reading.desk.with(|bench| bench.world.bus.borrow().traffic());
    assert!(ended.damaged > began.damaged && ended.lost > began.lost, "{began:?} {ended:?}");
}
