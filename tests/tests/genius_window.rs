//! Every command over a host's GENI window, with the real client, against the native recorder and
//! against the ARM image.
#![cfg(unix)]

use std::time::{Duration, Instant};

use ser_client::{Delivery, GeniHost, Options, Unit, Unsolicited};
use ser_proto::genius::{ForceTable, GlobalData};
use ser_proto::{
    AutoReport, Code, Command, Configuration, Entry, Inputs, Model, ReadReply, Reply, TimeStamp,
};
use ser_sim::genius::Noise;
use ser_sim::testing::{Kind, PATIENCE};
use ser_sim::with_both_kinds;
use ser_trial::recorder::{NODE, PATIENT, Recorder, assert_entries_are, listen, stamp_ms};

with_both_kinds! {
    every_command_is_answered,
    a_datagram_brings_ten_entries_of_16_inputs,
    a_datagram_brings_seven_entries_of_32_inputs,
    broadcasts_are_carried_out_and_remembered,
    inputs_and_forces_are_seen_on_the_bus,
    auto_report_reports_every_event_to_the_host,
    a_full_log_is_read_over_both_ports_while_events_keep_arriving,
    a_power_cycle_brings_the_recorder_back_onto_the_bus,
    a_noisy_bus_costs_repetitions_and_no_event,
}

const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

/// A recorder, its host, and a client there.
fn start(kind: Kind, model: Model) -> (Recorder, GeniHost, Unit) {
    let recorder = Recorder::start_on_bus(kind, model);
    let host = recorder.host();
    let unit = host.unit(NODE, PATIENT);
    (recorder, host, unit)
}

/// Moves input 1 every `period_ms`, `count` times.
fn toggling(count: u64, period_ms: u64) -> Vec<(u64, u8, bool)> {
    (0..count).map(|index| (index * period_ms, 1, index % 2 == 0)).collect()
}

fn read_all(unit: &mut Unit) -> Vec<Entry> {
    let mut entries = Vec::new();
    unit.read_new(&mut None, 2048, &mut |delivery| match delivery {
        Delivery::Event { entry, .. } => entries.push(entry),
        Delivery::Lost { lost, .. } => panic!("{lost:?}"),
    })
    .expect("the log is read");
    entries
}

fn every_command_is_answered(kind: Kind) {
    let (recorder, _, mut unit) = start(kind, Model::Ser320);
    assert_eq!(unit.set_clock(|_| TEN_O_CLOCK).expect("the clock is set"), TEN_O_CLOCK);
    recorder.play(&[(0, 3, true), (7, 32, true), (7, 1, true), (20, 3, false)]);
    let entries = read_all(&mut unit);
    assert_entries_are(&entries, &recorder.played());
    let patience_ms = i64::try_from(PATIENCE.as_millis()).expect("minutes");
    let since_ms = stamp_ms(&entries[0]) - stamp_ms(&Entry { time: TEN_O_CLOCK, ..entries[0] });
    assert!((0..patience_ms).contains(&since_ms), "stamped {since_ms} ms after the clock was set");

    assert!(unit.mode().expect("the mode").recording);
    assert!(!unit.set_recording(false).expect("stopped").recording);
    recorder.play(&[(0, 5, true)]);
    assert!(unit.set_recording(true).expect("started").recording);
    assert_eq!(
        unit.log_position().expect("the log").total,
        3,
        "what changed while stopped is no event"
    );

    assert_eq!(unit.configuration().expect("the defaults"), Configuration::default());
    let smaller = Configuration { size: 100, ..Configuration::default() };
    assert_eq!(unit.configure(smaller.into()).expect("configured"), smaller);
    assert_eq!(unit.last_broadcast().expect("a reply"), None);

    // What is printed comes out of the serial port.
    let mut on_line = recorder.unit();
    on_line.mode().expect("the line is up");
    unit.print(2, 2).expect("accepted");
    let mut lines = Vec::new();
    listen(&mut on_line, |message| {
        if let Unsolicited::Line(line) = message {
            lines.push(line.text);
        }
        lines.len() == 2
    });
    assert!(lines[0].starts_with("0002 ") && lines[1].starts_with("0003 "), "{lines:?}");

    unit.erase().expect("erased");
    assert_eq!(unit.log_position().expect("the log").total, 0);
    recorder.assert_lawful();
}

fn a_datagram_brings_ten_entries_of_16_inputs(kind: Kind) {
    one_datagram(kind, Model::Ser160, 10, 128);
}

fn a_datagram_brings_seven_entries_of_32_inputs(kind: Kind) {
    one_datagram(kind, Model::Ser320, 7, 120);
}

fn one_datagram(kind: Kind, model: Model, entries: usize, len: usize) {
    let (recorder, _, mut unit) = start(kind, model);
    recorder.play(&toggling(17, 1));
    let reply = unit.request(&Command::Read { start: 3, count: 10 }).expect("a reply");
    assert_eq!(reply.to_body().len(), len);
    let Reply::Read(ReadReply { start, total, entries: read, .. }) = reply else {
        panic!("{reply:?}")
    };
    assert_eq!((start, total, read.len()), (3, 17, entries));
    // The client asks for the rest.
    assert_entries_are(&read_all(&mut unit), &recorder.played());
    recorder.assert_lawful();
}

fn broadcasts_are_carried_out_and_remembered(kind: Kind) {
    let (recorder, host, mut unit) = start(kind, Model::Ser160);
    let heard = |unit: &mut Unit, code: Code| {
        // A broadcast is not answered. The effect shows that it was heard.
        let deadline = Instant::now() + PATIENCE;
        loop {
            let last = unit.last_broadcast().expect("a reply");
            if let Some(last) = last.filter(|last| last.code == code.byte()) {
                return last;
            }
            assert!(Instant::now() < deadline, "{last:?}");
        }
    };
    host.broadcast(&Command::SetClock(TEN_O_CLOCK)).expect("it is on the bus");
    let last = heard(&mut unit, Code::SetClock);
    assert_eq!((last.hour, last.minute), (10, 0));
    recorder.play(&[(0, 16, true)]);
    host.broadcast(&Command::SetMode { recording: false }).expect("it is on the bus");
    heard(&mut unit, Code::Mode);
    assert!(!unit.mode().expect("the mode").recording);
    host.broadcast(&Command::Erase).expect("it is on the bus");
    heard(&mut unit, Code::Erase);
    assert_eq!(unit.log_position().expect("the log").total, 0);
    recorder.assert_lawful();
}

fn inputs_and_forces_are_seen_on_the_bus(kind: Kind) {
    let (recorder, host, _) = start(kind, Model::Ser320);
    recorder.play(&[(0, 1, true), (0, 17, true), (3, 32, true)]);
    let closed = GlobalData { model: Model::Ser320, state: Inputs(1 | 1 << 16 | 1 << 31) };
    let deadline = Instant::now() + PATIENCE;
    loop {
        let devices = host.devices().expect("the board is well");
        let device = devices.iter().find(|device| device.number == NODE).expect("the recorder");
        if device.inputs == closed.to_bytes()[..] {
            break;
        }
        assert!(Instant::now() < deadline, "{:02X?}", device.inputs);
    }
    let forces = host.read_forces(NODE, ForceTable::InputEnable).expect("a reply");
    assert_eq!(forces.contents, [0; 4]);
    let values = host.read_forces(NODE, ForceTable::InputValues).expect("a reply");
    assert_eq!(values.contents[..], closed.to_bytes()[..]);
    recorder.assert_lawful();
}

fn auto_report_reports_every_event_to_the_host(kind: Kind) {
    let (recorder, host, mut unit) = start(kind, Model::Ser160);
    let auto_report = Configuration {
        auto_report: AutoReport::Genius,
        report_address: host.number(),
        ..Configuration::default()
    };
    unit.configure(auto_report.into()).expect("configured");
    recorder.play(&toggling(50, 1));
    let mut reported: Vec<Entry> = Vec::new();
    listen(&mut unit, |message| {
        let Unsolicited::Report(ReadReply { start, entries, .. }) = message else {
            panic!("{message:?}")
        };
        assert_eq!(usize::from(start), reported.len() + 1, "in order, without a gap");
        reported.extend(entries);
        reported.len() == 50
    });
    assert_entries_are(&reported, &recorder.played());
    recorder.assert_lawful();
}

/// Two hosts, one on each port: each gets every event, in order, without a gap.
fn a_full_log_is_read_over_both_ports_while_events_keep_arriving(kind: Kind) {
    let (recorder, _, mut on_bus) = start(kind, Model::Ser160);
    let mut on_line = recorder.unit();
    recorder.play(&toggling(1500, 1));
    recorder.start_playing(&toggling(500, 2));
    let (mut bus_cursor, mut line_cursor) = (None, None);
    let (mut over_bus, mut over_line) = (Vec::new(), Vec::new());
    let mut last = false;
    while !last {
        // One more reading after the last contact has moved finds the rest.
        last = recorder.played().len() == 2000;
        let units = [
            (&mut on_bus, &mut bus_cursor, &mut over_bus),
            (&mut on_line, &mut line_cursor, &mut over_line),
        ];
        for (unit, cursor, entries) in units {
            unit.read_new(cursor, 2048, &mut |delivery| match delivery {
                Delivery::Event { entry, .. } => entries.push(entry),
                Delivery::Lost { lost, .. } => panic!("{lost:?}"),
            })
            .expect("the log is read");
        }
    }
    recorder.wait_played();
    assert_entries_are(&over_bus, &recorder.played());
    assert_eq!(over_bus, over_line);
    recorder.assert_lawful();
}

fn a_power_cycle_brings_the_recorder_back_onto_the_bus(kind: Kind) {
    let (recorder, host, mut unit) = start(kind, Model::Ser160);
    let wanted = Configuration { size: 512, ..Configuration::default() };
    unit.configure(wanted.into()).expect("configured");
    recorder.play(&toggling(3, 1));
    recorder.power_cycle();
    host.find(NODE).expect("it is logged in again");
    assert_eq!(unit.configuration().expect("it remembers"), wanted);
    assert_eq!(unit.log_position().expect("the log").total, 0, "the log is gone with the power");
    recorder.play(&[(0, 2, true)]);
    assert_eq!(read_all(&mut unit).len(), 1);
    recorder.assert_lawful();
}

/// One message in ten is damaged, lost or not acknowledged.
fn a_noisy_bus_costs_repetitions_and_no_event(kind: Kind) {
    let noise =
        Noise { seed: 7, damaged_ppm: 40_000, lost_ppm: 40_000, unacknowledged_ppm: 20_000 };
    let recorder = Recorder::start_on_noisy_bus(kind, Model::Ser320, noise);
    let mut unit =
        recorder.host().unit(NODE, Options { timeout: Duration::from_secs(4), retries: 20 });
    recorder.play(&toggling(100, 1));
    assert_entries_are(&read_all(&mut unit), &recorder.played());
    recorder.assert_lawful();
}
