//! Every command of a host over Genius, and everything that is not a command.

use std::rc::Rc;

use geni_board::Destination::{Broadcast, Device};
use geni_board::{Configuration, Driver, Event, Options, ReceivedDatagram, Start};
use ser_proto::{
    AutoReport, Baud, ClockSource, Code, Command, Configure, Counter, Entry, Inputs, LastBroadcast,
    Mode, Model, Reply, TimeStamp,
};
use ser_sim::genius::{Board, BoardOptions, BoardWindow};
use ser_trial::genius_world::{HOST, World};

const UNIT: u8 = 5;

const NOON: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 250 };

fn started(model: Model) -> World {
    World::started(&[(UNIT, model)])
}

/// Makes `count` events on input 1, a millisecond apart.
fn events(world: &mut World, count: u32) {
    for event in 0..count {
        world.recorders[0].contact(1, event % 2 == 0);
        world.step();
    }
}

fn read(world: &mut World, start: u16, count: u8) -> ser_proto::ReadReply {
    match world.ask(UNIT, &Command::Read { start, count }) {
        Reply::Read(reply) => reply,
        other => panic!("{other:?}"),
    }
}

/// Reads `count` entries of the log.
fn log(world: &mut World, start: u16, count: u16) -> Vec<Entry> {
    let mut entries = Vec::new();
    for at in start..start + count {
        entries.extend(read(world, at, 1).entries);
    }
    assert_eq!(entries.len(), usize::from(count));
    entries
}

const fn unchanged() -> Configure {
    Configure {
        size: None,
        baud: None,
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    }
}

#[test]
fn every_command_is_answered_over_genius() {
    let mut world = started(Model::Ser160);
    assert_eq!(world.ask(UNIT, &Command::SetClock(NOON)), Reply::ClockSet);
    events(&mut world, 3);
    let reply = read(&mut world, 1, 10);
    assert_eq!((reply.start, reply.total, reply.next_slot, reply.entries.len()), (1, 3, 3, 3));
    assert_eq!((reply.entries[1].changed, reply.entries[1].state), (Inputs(1), Inputs(0)));
    assert_eq!(reply.entries[0].time.hour, 12);
    let header = read(&mut world, 1, 0);
    assert_eq!((header.total, header.entries.len()), (3, 0));

    let Reply::Mode(Mode { recording: true, version }) = world.ask(UNIT, &Command::QueryMode)
    else {
        panic!()
    };
    assert_eq!(version, ser_node::VERSION);
    let stopped = world.ask(UNIT, &Command::SetMode { recording: false });
    assert_eq!(stopped, Reply::Mode(Mode { recording: false, version }));
    events(&mut world, 2);
    assert_eq!(read(&mut world, 1, 0).total, 3);
    world.ask(UNIT, &Command::SetMode { recording: true });

    let Reply::Configuration(before) = world.ask(UNIT, &Command::QueryConfiguration) else {
        panic!()
    };
    let configure = Configure { size: Some(100), ..unchanged() };
    let Reply::Configuration(after) = world.ask(UNIT, &Command::Configure(configure)) else {
        panic!()
    };
    assert_eq!((before.size, after.size), (2048, 100));

    assert_eq!(world.ask(UNIT, &Command::LastBroadcast), Reply::LastBroadcast(None));
    assert_eq!(world.ask(UNIT, &Command::Erase), Reply::Erased);
    assert_eq!(read(&mut world, 1, 0).total, 0);
    world.assert_lawful();
}

#[test]
fn ten_entries_of_16_inputs_and_seven_of_32_come_in_one_datagram() {
    for (model, entries, len) in [(Model::Ser160, 10, 128), (Model::Ser320, 7, 120)] {
        let mut world = started(model);
        events(&mut world, 12);
        let bytes = world.ask_bytes(UNIT, &Command::Read { start: 1, count: 10 });
        assert_eq!(bytes.len(), len);
        let Ok(Reply::Read(reply)) = Reply::parse(&bytes) else { panic!() };
        assert_eq!((reply.entries.len(), reply.model), (entries, Some(model)));
        world.assert_lawful();
    }
}

#[test]
fn print_over_genius_prints_on_rs_232() {
    let mut world = started(Model::Ser160);
    events(&mut world, 2);
    world.recorders[0].serial_said();
    assert_eq!(world.ask(UNIT, &Command::Print { start: 1, count: 9 }), Reply::PrintAccepted);
    world.step();
    let (replies, text) = world.recorders[0].serial_said();
    assert_eq!((replies.len(), text.lines().count()), (0, 2), "{text}");
    world.assert_lawful();
}

#[test]
fn a_baud_rate_set_over_genius_is_in_force_on_rs_232() {
    let mut world = started(Model::Ser160);
    let configure = Configure { baud: Some(Baud::B19200), ..unchanged() };
    world.ask(UNIT, &Command::Configure(configure));
    world.step();
    assert_eq!(world.recorders[0].node.baud(), Baud::B19200);
    let Reply::Configuration(now) = world.recorders[0].serial_ask(&Command::QueryConfiguration)
    else {
        panic!()
    };
    assert_eq!(now.baud, Baud::B19200);
}

#[test]
fn a_broadcast_is_carried_out_and_not_answered() {
    let mut world = started(Model::Ser160);
    events(&mut world, 2);
    for (command, total) in [
        (Command::SetClock(NOON), 2),
        (Command::Read { start: 1, count: 1 }, 2),
        (Command::Print { start: 1, count: 2 }, 2),
        (Command::Erase, 0),
    ] {
        world.send(Broadcast, &command);
        world.run(50);
        assert_eq!(world.take_message(UNIT), None, "{command:?}");
        assert_eq!(world.recorders[0].serial_said().1, "", "{command:?}");
        let Reply::LastBroadcast(Some(last)) = world.ask(UNIT, &Command::LastBroadcast) else {
            panic!()
        };
        assert_eq!((last.code, last.hour), (command.code().byte(), 12), "{command:?}");
        assert_eq!(read(&mut world, 1, 0).total, total, "{command:?}");
    }
    // What was not a command was not a broadcast.
    world.transmit(Broadcast, 0x40, 0x50, &[0x53, 26, 2, 30, 0, 0, 0, 0, 0]);
    world.transmit(Broadcast, 0x40, 0x50, &[0x99]);
    world.run(50);
    assert_eq!(world.take_message(UNIT), None);
    let Reply::LastBroadcast(Some(LastBroadcast { code, .. })) =
        world.ask(UNIT, &Command::LastBroadcast)
    else {
        panic!()
    };
    assert_eq!(code, Code::Erase.byte());
    world.assert_lawful();
}

#[test]
fn a_broadcast_question_for_the_time_is_a_mark_that_nobody_answers() {
    let mut world = started(Model::Ser160);
    world.ask(UNIT, &Command::SetClock(NOON));
    let reading = |world: &mut World, token| match world.ask(UNIT, &Command::Time { token }) {
        Reply::Time(reading) => reading,
        other => panic!("{other:?}"),
    };
    let before = reading(&mut world, 1);
    assert_eq!((before.token, before.last_mark), (1, None));
    assert_eq!(before.source, ClockSource::HostOverGenius);
    world.send(Broadcast, &Command::Time { token: 7 });
    world.run(50);
    assert_eq!(world.take_message(UNIT), None);
    let after = reading(&mut world, 2);
    let mark = after.last_mark.expect("it was broadcast");
    assert_eq!(mark.token, 7);
    assert!((before.clock_us..after.clock_us).contains(&mark.clock_us), "{mark:?}");
    let Reply::LastBroadcast(Some(last)) = world.ask(UNIT, &Command::LastBroadcast) else {
        panic!()
    };
    // Both say when it came, one to the millisecond.
    assert_eq!(last.code, Code::Time.byte());
    let ms = mark.clock_us / 1000 % 1000;
    assert_eq!(i64::from(last.millisecond), ms);
    world.assert_lawful();
}

#[test]
fn a_recorder_says_over_genius_too_who_it_is_and_what_it_counted() {
    let mut world = started(Model::Ser320);
    let Reply::Identity(identity) = world.ask(UNIT, &Command::Identify) else { panic!() };
    assert_eq!((identity.model, identity.life), (Model::Ser320, 1));
    world.transmit(Broadcast, 0x40, 0x50, &[0x99]);
    world.run(50);
    let first = Counter::COMMANDS_UNKNOWN;
    let Reply::Diagnostics(page) = world.ask(UNIT, &Command::Diagnostics { first }) else {
        panic!()
    };
    assert_eq!(page.counters().next(), Some((first, 1)));
    let first = Counter::DATAGRAMS_IGNORED;
    let Reply::Diagnostics(page) = world.ask(UNIT, &Command::Diagnostics { first }) else {
        panic!()
    };
    assert_eq!(page.first, first, "and those of its Genius port");
    world.assert_lawful();
}

#[test]
fn read_io_forces_shows_that_nothing_is_forced() {
    let mut world = started(Model::Ser160);
    world.recorders[0].contact(1, true);
    world.recorders[0].contact(16, true);
    world.run(10);
    let expected: [&[u8]; 4] = [&[0, 0, 0], &[1], &[2, 0x01, 0x80], &[3]];
    for (table, expected) in (0..).zip(expected) {
        world.transmit(Device(UNIT), 0x20, 0x40, &[table]);
        let reply = world.until("the reply", |world| world.host.inbox.pop_front()).1;
        assert_eq!((reply.source, reply.function, reply.subfunction), (UNIT, 0x20, 0x41));
        assert_eq!(&reply.data[..], expected);
    }
    world.transmit(Device(UNIT), 0x20, 0x40, &[4]);
    world.run(50);
    assert!(world.host.inbox.is_empty());
    world.assert_lawful();
}

#[test]
fn a_command_of_another_length_is_not_carried_out() {
    let mut world = started(Model::Ser160);
    world.ask(UNIT, &Command::SetClock(NOON));
    events(&mut world, 3);
    let Reply::Configuration(before) = world.ask(UNIT, &Command::QueryConfiguration) else {
        panic!()
    };
    let wrong = [
        &b"E\0"[..],
        b"M\0\0\0",
        b"S\x1A\x0B\x16\x17\0\0\0",
        b"S\x1A\x0B\x16\x17\0\0\0\0\0",
        b"C\0\x64\x06\x02",
        b"C\0\x64\x06\x02\x01\x01\0",
    ];
    for data in wrong {
        for to in [Device(UNIT), Broadcast] {
            world.transmit(to, 0x40, 0x50, data);
            world.run(50);
        }
    }
    assert_eq!(world.take_message(UNIT), None);
    assert_eq!(world.ask(UNIT, &Command::QueryConfiguration), Reply::Configuration(before));
    assert!(matches!(
        world.ask(UNIT, &Command::QueryMode),
        Reply::Mode(Mode { recording: true, .. })
    ));
    assert_eq!(world.ask(UNIT, &Command::LastBroadcast), Reply::LastBroadcast(None));
    world.recorders[0].contact(1, false);
    world.step();
    let after = read(&mut world, 4, 1);
    assert_eq!((after.total, after.entries[0].time.hour), (4, NOON.hour), "neither erased nor set");
}

#[test]
fn datagrams_of_any_content_and_length_are_counted_and_ignored() {
    let mut world = started(Model::Ser160);
    let before = world.recorders[0].node.diagnostics();
    for len in [0, 1, 5, 128, 134] {
        for (function, subfunction) in
            [(0x40, 0x50), (0x40, 0x51), (0x20, 0x40), (0x20, 0x13), (112, 255)]
        {
            world.transmit(Device(UNIT), function, subfunction, &vec![0x99; len]);
            world.transmit(Broadcast, function, subfunction, &vec![0x45; len]);
            world.run(20);
        }
    }
    let after = world.recorders[0].node.diagnostics();
    // Only one of these broadcasts is a command: the one that consists of the erase byte alone.
    assert_eq!(world.recorders[0].port.diagnostics().broadcasts, 1);
    assert_eq!(after.frames_empty - before.frames_empty, 2);
    assert_eq!(after.commands_unknown - before.commands_unknown, 4);
    assert_eq!(after.commands_wrong_length - before.commands_wrong_length, 3);
    assert!(world.recorders[0].port.diagnostics().datagrams_ignored >= 40);
    assert_eq!(world.take_message(UNIT), None);
    assert!(matches!(world.ask(UNIT, &Command::QueryMode), Reply::Mode(_)));
    world.assert_lawful();
}

#[test]
fn auto_reports_go_to_the_configured_address_once_each() {
    let mut world = started(Model::Ser160);
    events(&mut world, 4);
    let configure =
        Configure { auto_report: AutoReport::Genius, report_address: HOST, ..unchanged() };
    world.ask(UNIT, &Command::Configure(configure));
    events(&mut world, 26);
    world.run(300);
    let mut entries = Vec::new();
    while let Some((_, data)) = world.take_message(UNIT) {
        let Ok(Reply::Read(report)) = Reply::parse(&data) else { panic!() };
        entries.extend(report.entries);
    }
    // Events from before are not reported.
    assert_eq!(entries, log(&mut world, 5, 26));
    // Events that are recorded while nobody is there are reported when somebody is.
    let fault =
        ser_sim::genius::Fault::Disconnect { device: world.host.board.id(), for_us: 5_000_000 };
    world.bus.borrow_mut().inject(fault);
    events(&mut world, 26);
    world.run(5_000);
    assert_eq!(world.take_message(UNIT), None);
    world.run(5_000);
    let mut late = Vec::new();
    while let Some((_, data)) = world.take_message(UNIT) {
        let Ok(Reply::Read(report)) = Reply::parse(&data) else { panic!() };
        late.extend(report.entries);
    }
    assert_eq!(late, log(&mut world, 31, 26));
    assert!(world.recorders[0].port.diagnostics().reports_failed > 0);
    assert_eq!(world.recorders[0].node.diagnostics().events_unreported, 0);
    world.assert_lawful();
}

#[test]
fn recorders_that_report_without_end_leave_everybody_a_turn() {
    let numbers = [5, 6, 7];
    let mut world = World::started(&numbers.map(|number| (number, Model::Ser320)));
    let configure =
        Configure { auto_report: AutoReport::Genius, report_address: HOST, ..unchanged() };
    for number in numbers {
        world.ask(number, &Command::Configure(configure));
    }
    // For a minute there are more events than all reports together can bring. The host has the last
    // turn in every scan.
    let mut answered = [0; 3];
    let mut asked_at_ms = 0;
    let end_ms = world.now_ms + 60_000;
    let mut turn = 0;
    while world.now_ms < end_ms {
        for recorder in &mut world.recorders {
            recorder.contact(1, world.now_ms.is_multiple_of(2));
        }
        world.step();
        for (index, number) in numbers.into_iter().enumerate() {
            while let Some((_, data)) = world.take_message(number) {
                let is_answer = matches!(Reply::parse(&data), Ok(Reply::Mode(_)));
                answered[index] += u32::from(is_answer);
                turn += usize::from(is_answer);
                asked_at_ms = if is_answer { 0 } else { asked_at_ms };
            }
        }
        if asked_at_ms == 0 {
            asked_at_ms = world.now_ms;
            world.send(Device(numbers[turn % 3]), &Command::QueryMode);
        }
        let waits_ms = world.now_ms - asked_at_ms;
        assert!(waits_ms < 1_000, "{waits_ms} ms without an answer after {answered:?}");
    }
    assert!(answered.iter().all(|&count| count > 100), "{answered:?}");
    let reports = world.recorders.iter().map(|recorder| recorder.port.diagnostics().reports_sent);
    assert!(reports.clone().all(|sent| sent > 1_000), "{:?}", reports.collect::<Vec<_>>());
    assert_eq!(world.host.driver.counters().commands_timed_out, 0);
    world.assert_lawful();
}

/// Another host on the bus, which knows the recorder.
fn second_host(world: &mut World, number: u8) -> Driver<BoardWindow> {
    let board = world.bus.borrow_mut().connect(Board::new(BoardOptions::at(number)));
    let window = BoardWindow::new(Rc::clone(&world.bus), board);
    let options =
        Options { start: Start::Reset { hold_ms: 20 }, ..Options::new(Configuration::DEFAULT) };
    let mut host = Driver::new(window, options);
    world.until("the second host knows the recorder", |world| {
        look(&mut host, world);
        (host.device(UNIT).is_ok() && host.can_transmit()).then_some(())
    });
    host
}

/// What a host has received, if anything.
fn look(host: &mut Driver<BoardWindow>, world: &World) -> Option<ReceivedDatagram> {
    let event = host.poll(u32::try_from(world.now_ms).expect("less than 49 days"));
    let held = host.reset_held();
    host.ram_mut().drive_reset(held);
    match event {
        Some(Event::Received(received)) => Some(received),
        _ => None,
    }
}

#[test]
fn of_two_hosts_that_ask_each_gets_the_answer_to_its_own_question() {
    let mut world = started(Model::Ser160);
    let mut second = second_host(&mut world, 30);
    for _ in 0..10 {
        world.send(Device(UNIT), &Command::QueryConfiguration);
        let question = geni_board::Transmission {
            destination: Device(UNIT),
            function: 0x40,
            subfunction: 0x50,
            priority: geni_board::TransmitPriority::Normal,
            completion: geni_board::Completion::Acknowledged,
            data: geni_board::Data::from_slice(b"M").expect("a byte"),
        };
        second.transmit(question).expect("the board is free");
        let (mut first_got, mut second_got) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            world.step();
            second_got.extend(look(&mut second, &world).map(|received| received.data));
            first_got.extend(world.take_message(UNIT).map(|(_, data)| data));
        }
        let [Ok(Reply::Configuration(_))] =
            first_got.iter().map(|data| Reply::parse(data)).collect::<Vec<_>>()[..]
        else {
            panic!("{first_got:?}")
        };
        let [Ok(Reply::Mode(_))] =
            second_got.iter().map(|data| Reply::parse(data)).collect::<Vec<_>>()[..]
        else {
            panic!("{second_got:?}")
        };
    }
    world.assert_lawful();
}

#[test]
fn what_one_port_configures_or_erases_holds_for_the_other() {
    let mut world = started(Model::Ser160);
    events(&mut world, 4);
    // Auto report moves to RS-232 by a command over Genius, and begins with the next event.
    world.ask(
        UNIT,
        &Command::Configure(Configure { auto_report: AutoReport::Rs232, ..unchanged() }),
    );
    world.step();
    assert_eq!(world.recorders[0].serial_said().0, []);
    events(&mut world, 2);
    let reported = world.recorders[0].serial_said().0;
    let starts: Vec<u16> = reported
        .iter()
        .map(|reply| if let Reply::Read(reply) = reply { reply.start } else { panic!("{reply:?}") })
        .collect();
    assert_eq!(starts, [5, 6]);

    // Reports go back to Genius, to a host that is not there. After an erase over RS-232 nothing is
    // owed to it any more.
    let configure =
        Configure { auto_report: AutoReport::Genius, report_address: 30, ..unchanged() };
    let Reply::Configuration(_) = world.recorders[0].serial_ask(&Command::Configure(configure))
    else {
        panic!()
    };
    events(&mut world, 2);
    world.run(100);
    assert_eq!(world.recorders[0].serial_ask(&Command::Erase), Reply::Erased);
    let configure = Configure { report_address: HOST, ..configure };
    world.recorders[0].serial_ask(&Command::Configure(configure));
    world.run(6_000);
    assert_eq!(world.take_message(UNIT), None);
    events(&mut world, 2);
    let (_, data) = world.until("a report", |world| world.take_message(UNIT));
    let Ok(Reply::Read(report)) = Reply::parse(&data) else { panic!() };
    assert_eq!((report.start, report.total), (1, report.entries.len().try_into().expect("two")));

    // After an erase over Genius nothing is left to print.
    world.ask(UNIT, &Command::Configure(Configure { auto_print: true, ..unchanged() }));
    world.ask(UNIT, &Command::Erase);
    events(&mut world, 2);
    let (_, text) = world.recorders[0].serial_said();
    assert_eq!(text.lines().count(), 2, "{text}");
    world.assert_lawful();
}
