//! Boards that fail, queues that fill: the recorder recovers by itself, RS-232 goes on, and no
//! event is lost.

use geni_board::Destination::Device;
use geni_board::SharedRam;
use ser_proto::{Command, Inputs, Model, Reply};
use ser_sim::genius::{DeviceFault, Fault};
use ser_trial::genius_world::World;

const UNIT: u8 = 5;

/// The longest time until a failed board is noticed, reset, tested, configured and back on the bus.
const RECOVERY_MS: u64 = 8_000;

fn started() -> World {
    World::started(&[(UNIT, Model::Ser160)])
}

fn inject(world: &mut World, fault: DeviceFault) {
    let device = world.recorders[0].board.id();
    world.bus.borrow_mut().inject(Fault::Inside { device, fault });
}

/// Toggles input 1 for this long and asks over RS-232 for what was recorded. Returns how many
/// events there were.
fn live_on(world: &mut World, ms: u64) -> u16 {
    let mut events = 0;
    for _ in 0..ms / 100 {
        events += 1;
        world.recorders[0].contact(1, events % 2 == 1);
        world.run(100);
        let reply = world.recorders[0].serial_ask(&Command::Read { start: events, count: 1 });
        let Reply::Read(reply) = reply else { panic!("{reply:?}") };
        assert_eq!((reply.total, reply.entries[0].changed), (events, Inputs(1)));
    }
    events
}

/// Checks that everything is as before, also over Genius.
fn assert_recovered(world: &mut World, events: u16) {
    assert!(world.recorders[0].port.is_ready());
    let Reply::Read(reply) = world.ask(UNIT, &Command::Read { start: 1, count: 0 }) else {
        panic!()
    };
    assert_eq!(reply.total, events);
    assert_eq!(world.global(UNIT, 2), [u8::from(events % 2 == 1), 0]);
    world.assert_lawful_but_for_a_reset();
}

#[test]
fn a_board_that_fails_is_restarted_while_rs_232_goes_on() {
    for fault in [DeviceFault::Hang, DeviceFault::FailSelfTest(0x04), DeviceFault::Reset] {
        let mut world = started();
        inject(&mut world, fault);
        let events = live_on(&mut world, RECOVERY_MS);
        assert!(world.recorders[0].port.diagnostics().last_failure.is_some(), "{fault:?}");
        assert_recovered(&mut world, events);
    }
}

#[test]
fn a_board_that_fails_its_self_test_at_start_is_tried_again() {
    let mut world = started();
    inject(&mut world, DeviceFault::FailNextStart(0x02));
    inject(&mut world, DeviceFault::Hang);
    let events = live_on(&mut world, 2 * RECOVERY_MS);
    assert!(world.recorders[0].port.diagnostics().board.failures >= 2);
    assert_recovered(&mut world, events);
}

#[test]
fn a_board_that_restarts_in_the_middle_of_a_command_is_configured_anew() {
    // Each failure comes a little later in the exchange of command and reply.
    for delay_ms in [0, 1, 2, 3, 4, 5, 6, 8, 10] {
        let mut world = started();
        world.send(Device(UNIT), &Command::QueryMode);
        world.run(delay_ms);
        inject(&mut world, DeviceFault::Reset);
        let events = live_on(&mut world, RECOVERY_MS);
        while world.take_message(UNIT).is_some() {}
        assert_recovered(&mut world, events);
    }
}

#[test]
fn a_board_that_answers_late_or_has_no_memory_is_waited_for() {
    let mut world = started();
    world.report_to_host();
    inject(&mut world, DeviceFault::AnswerLate { by_us: 30_000 });
    inject(&mut world, DeviceFault::OutOfMemory { datagrams: 5 });
    let events = live_on(&mut world, 3_000);
    let mut reported = 0;
    world.run(1_000);
    while let Some((_, data)) = world.take_message(UNIT) {
        let Ok(Reply::Read(report)) = Reply::parse(&data) else { panic!() };
        reported += u16::try_from(report.entries.len()).expect("at most ten");
    }
    assert_eq!(reported, events);
    assert!(world.recorders[0].port.diagnostics().reports_failed >= 5);
    assert_recovered(&mut world, events);
}

#[test]
fn reports_outlive_a_board() {
    let mut world = started();
    world.report_to_host();
    inject(&mut world, DeviceFault::Hang);
    let events = live_on(&mut world, RECOVERY_MS);
    world.run(1_000);
    let mut reported = Vec::new();
    while let Some((_, data)) = world.take_message(UNIT) {
        let Ok(Reply::Read(report)) = Reply::parse(&data) else { panic!() };
        reported.extend(
            report.start..report.start + u16::try_from(report.entries.len()).expect("at most ten"),
        );
    }
    // A report may come twice if it was acknowledged to a board that could no longer tell anybody.
    reported.dedup();
    assert_eq!(reported, (1..=events).collect::<Vec<_>>());
    assert_recovered(&mut world, events);
}

#[test]
fn requests_for_memory_are_refused_and_never_fill_the_queue() {
    let mut world = started();
    // Read Device: length, address.
    for _ in 0..60 {
        world.transmit(Device(UNIT), 0x20, 0x1E, &[4, 0, 0, 0]);
    }
    let events = live_on(&mut world, 2_000);
    let diagnostics = world.recorders[0].port.diagnostics().board;
    assert_eq!((diagnostics.requests_refused, diagnostics.request_queue_full), (60, 0));
    assert_recovered(&mut world, events);
}

/// Sends datagrams (destination, function, subfunction, data) while nobody polls the recorder's
/// port. Its board keeps them.
fn send_while_away(world: &mut World, datagrams: &[(u8, u8, u8, &[u8])]) {
    const MS_PER_DATAGRAM: u64 = 20;
    let bus = std::rc::Rc::clone(&world.bus);
    for &(destination, function, subfunction, data) in datagrams {
        let mut bus = bus.borrow_mut();
        let board = bus.get_mut(world.host.board);
        board.host_write_from(0x08D2, data);
        let len = u8::try_from(data.len()).expect("short");
        board.host_write_from(0x08C4, &[destination, function, subfunction, 0, len]);
        board.host_write(0x08C3, 2);
        board.host_write(0x08C2, 1);
        // The node's time goes on in one big step, as after a long interrupt.
        world.now_ms += MS_PER_DATAGRAM;
        bus.advance_to(world.now_ms * 1000);
    }
}

#[test]
fn a_recorder_that_was_away_finds_full_queues_and_empties_them() {
    let mut world = started();
    let query: (u8, u8, u8, &[u8]) = (UNIT, 0x40, 0x50, &[0x4D]);
    let read_device: (u8, u8, u8, &[u8]) = (UNIT, 0x20, 0x1E, &[4, 0, 0, 0]);
    send_while_away(&mut world, &[query, read_device].repeat(10));
    world.run(1_000);
    let mut replies = 0;
    while world.take_message(UNIT).is_some() {
        replies += 1;
    }
    assert_eq!(replies, 10);
    assert_eq!(world.recorders[0].port.diagnostics().board.requests_refused, 10);
    assert!(world.recorders[0].port.window().read(0x0893) <= 1);
    let events = live_on(&mut world, 1_000);
    assert_recovered(&mut world, events);
}

#[test]
fn a_broadcast_does_not_overtake_the_commands_before_it() {
    let mut world = started();
    for event in 0..3 {
        world.recorders[0].contact(1, event % 2 == 0);
        world.step();
    }
    let read = Command::Read { start: 1, count: 10 }.to_body();
    let erase = Command::Erase.to_body();
    send_while_away(
        &mut world,
        &[(UNIT, 0x40, 0x50, &read), (UNIT, 0x40, 0x50, &read), (255, 0x40, 0x50, &erase)],
    );
    world.run(1_000);
    for _ in 0..2 {
        let (_, reply) = world.take_message(UNIT).expect("a reply");
        let Ok(Reply::Read(read)) = Reply::parse(&reply) else { panic!("{reply:?}") };
        assert_eq!((read.total, read.entries.len()), (3, 3), "read before it was erased");
    }
    let Reply::Read(after) = world.ask(UNIT, &Command::Read { start: 1, count: 0 }) else {
        panic!()
    };
    assert_eq!(after.total, 0);
    let Reply::LastBroadcast(Some(last)) = world.ask(UNIT, &Command::LastBroadcast) else {
        panic!()
    };
    assert_eq!(last.code, erase[0]);
    world.assert_lawful();
}
