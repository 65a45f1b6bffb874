//! Every command over a pseudo-terminal, with the real client, against the native recorder and
//! against the ARM image.
#![cfg(unix)]

use std::time::Duration;

use ser_client::{Delivery, Endpoint, Lost, Unit, Unsolicited, open};
use ser_proto::{AutoReport, Baud, Configuration, Entry, Inputs, Model, ReadReply, TimeStamp};
use ser_sim::testing::{Kind, PATIENCE};
use ser_sim::with_both_kinds;
use ser_trial::recorder::{Recorder, assert_entries_are, listen, stamp_ms};

with_both_kinds! {
    set_clock_start_and_read,
    edges_one_millisecond_apart_on_32_inputs,
    mode_stops_and_starts_recording,
    configuration_is_set_shown_and_survives_a_power_cycle,
    the_line_follows_a_change_of_its_rate,
    erase_empties_the_log,
    last_broadcast_is_none_before_the_first,
    print_entries_prints_lines,
    auto_print_prints_every_event,
    auto_report_reports_every_event,
    malformed_frames_are_passed_over,
    a_full_ser160_log_is_read_while_events_keep_arriving,
    a_full_ser320_log_is_read_while_events_keep_arriving,
    an_overrun_log_says_exactly_how_many_are_lost,
    a_full_printout_keeps_the_recorder_from_nothing,
}

const TEN_O_CLOCK: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 0 };

fn read_all(unit: &mut Unit) -> Vec<Entry> {
    let mut entries = Vec::new();
    unit.read_new(&mut None, 2048, &mut |delivery| match delivery {
        Delivery::Event { entry, .. } => entries.push(entry),
        Delivery::Lost { lost, .. } => panic!("{lost:?}"),
    })
    .expect("the log is read");
    entries
}

/// Moves input 1 every `period_ms`, `count` times.
fn toggling(count: u64, period_ms: u64) -> Vec<(u64, u8, bool)> {
    (0..count).map(|index| (index * period_ms, 1, index % 2 == 0)).collect()
}

fn set_clock_start_and_read(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    assert_eq!(unit.set_clock(|_| TEN_O_CLOCK).expect("the clock is set"), TEN_O_CLOCK);
    recorder.play(&[(0, 3, true), (7, 16, true), (7, 1, true), (20, 3, false)]);
    let entries = read_all(&mut unit);
    assert_entries_are(&entries, &recorder.played());
    let changed: Vec<_> = entries.iter().map(|entry| entry.changed).collect();
    assert_eq!(changed, [Inputs(1 << 2), Inputs(1 << 15 | 1), Inputs(1 << 2)]);
    let patience_ms = i64::try_from(PATIENCE.as_millis()).expect("minutes");
    let ten_o_clock = stamp_ms(&Entry { time: TEN_O_CLOCK, ..entries[0] });
    let since_ms = stamp_ms(&entries[0]) - ten_o_clock;
    assert!((0..patience_ms).contains(&since_ms), "stamped {since_ms} ms after the clock was set");
}

fn edges_one_millisecond_apart_on_32_inputs(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser320);
    let mut unit = recorder.unit();
    let on = (0..32).map(|index| (u64::from(index), index + 1, true));
    let off = (0..32).map(|index| (32 + u64::from(index), 32 - index, false));
    recorder.play(&on.chain(off).collect::<Vec<_>>());
    let entries = read_all(&mut unit);
    assert_entries_are(&entries, &recorder.played());
    if kind == Kind::Native {
        let deltas: Vec<_> =
            entries.windows(2).map(|pair| stamp_ms(&pair[1]) - stamp_ms(&pair[0])).collect();
        assert_eq!(deltas, [1; 63]);
    }
}

fn mode_stops_and_starts_recording(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    assert!(unit.mode().expect("the mode").recording, "recording is on after power-up");
    assert!(!unit.set_recording(false).expect("stopped").recording);
    recorder.play(&[(0, 1, true), (5, 2, true)]);
    assert!(unit.set_recording(true).expect("started").recording);
    recorder.play(&[(0, 3, true)]);
    let entries = read_all(&mut unit);
    assert_eq!(entries.len(), 1, "what changed while stopped is no event");
    assert_eq!((entries[0].changed, entries[0].state), (Inputs(0b100), Inputs(0b111)));
}

fn configuration_is_set_shown_and_survives_a_power_cycle(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    assert_eq!(unit.configuration().expect("the defaults"), Configuration::default());
    let wanted = Configuration {
        size: 1024,
        baud: Baud::B9600,
        auto_report: AutoReport::Genius,
        report_address: 1,
        auto_print: false,
    };
    assert_eq!(unit.configure(wanted.into()).expect("the manual's example"), wanted);
    recorder.play(&[(0, 1, true)]);
    drop(unit);
    recorder.power_cycle();
    let mut unit = recorder.unit();
    assert_eq!(unit.configuration().expect("it remembers"), wanted);
    assert_eq!(unit.log_position().expect("the log").total, 0, "the log is gone with the power");
}

fn the_line_follows_a_change_of_its_rate(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    for baud in [Baud::B300, Baud::B19200, Baud::B9600] {
        let wanted = Configuration { baud, ..Configuration::default() };
        assert_eq!(unit.configure(wanted.into()).expect("a reply at the old rate"), wanted);
        assert_eq!(unit.bits_per_second(), Some(baud.bits_per_second()));
        assert_eq!(unit.configuration().expect("a reply at the new rate"), wanted);
    }
}

fn erase_empties_the_log(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    recorder.play(&toggling(7, 1));
    assert_eq!(read_all(&mut unit).len(), 7);
    unit.erase().expect("erased");
    let position = unit.log_position().expect("the log");
    assert_eq!((position.total, position.next_slot), (0, 0));
    recorder.play(&[(0, 2, true)]);
    assert_eq!(read_all(&mut unit).len(), 1);
}

fn last_broadcast_is_none_before_the_first(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    assert_eq!(recorder.unit().last_broadcast().expect("a reply"), None);
}

fn lines(unit: &mut Unit, count: usize) -> Vec<String> {
    let mut lines = Vec::new();
    listen(unit, |message| {
        match message {
            Unsolicited::Line(line) => lines.push(line.text),
            Unsolicited::Report(report) => panic!("{report:?}"),
        }
        lines.len() == count
    });
    lines
}

fn print_entries_prints_lines(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser320);
    let mut unit = recorder.unit();
    unit.set_clock(|_| TEN_O_CLOCK).expect("the clock is set");
    recorder.play(&[(0, 1, true), (1, 32, true), (2, 1, false)]);
    unit.print(2, 300).expect("accepted");
    let lines = lines(&mut unit, 2);
    let entries = read_all(&mut unit);
    for ((line, entry), what) in lines.iter().zip(&entries[1..]).zip(["0002 32 ON", "0003 1 OFF"]) {
        let (number, change) = what.split_once(' ').expect("number and change");
        let time = entry.time.to_string().replace('T', " ");
        assert_eq!(*line, format!("{number} {time}  {change}"));
    }
}

fn auto_print_prints_every_event(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    let auto_print = Configuration { auto_print: true, ..Configuration::default() };
    unit.configure(auto_print.into()).expect("configured");
    recorder.play(&toggling(20, 3));
    let lines = lines(&mut unit, 20);
    for (number, line) in (1..).zip(&lines) {
        assert!(line.starts_with(&format!("{number:04} 20")), "{line}");
        assert!(line.ends_with(if number % 2 == 1 { "  1 ON" } else { "  1 OFF" }), "{line}");
    }
}

fn auto_report_reports_every_event(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser320);
    let mut unit = recorder.unit();
    let auto_report = Configuration { auto_report: AutoReport::Rs232, ..Configuration::default() };
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
}

fn malformed_frames_are_passed_over(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let endpoint: Endpoint = recorder.port().parse().expect("a port");
    let mut line = open(&endpoint, 9600).expect("the line");
    let malformed: [&[u8]; 8] = [
        b"\x1B0145",
        b"\x1B01G5",
        b"\x1B014546",
        b"\x1BFF",
        b"\x1B0000",
        b"\x1B015858",
        b"\x1B02450045",
        b"no frame at all \xFF\x00",
    ];
    for bytes in malformed {
        line.write_all(bytes).expect("written");
        line.write_all(b"\x1B014C4C").expect("written");
        let mut heard = Vec::<u8>::new();
        let expected = b"\x1B074C0000000000004C";
        while heard.len() < expected.len() {
            let mut buffer = [0; 64];
            let count = line.read(&mut buffer, PATIENCE).expect("the line is up");
            assert!(count > 0, "no answer after {bytes:X?}, only {heard:X?}");
            heard.extend(&buffer[..count]);
        }
        assert_eq!(heard, expected, "after {bytes:X?}");
    }
}

fn a_full_ser160_log_is_read_while_events_keep_arriving(kind: Kind) {
    full_log_while_events_keep_arriving(kind, Model::Ser160);
}

fn a_full_ser320_log_is_read_while_events_keep_arriving(kind: Kind) {
    full_log_while_events_keep_arriving(kind, Model::Ser320);
}

/// 2048 events fill the log. While it is read, 400 more come. Everything is delivered or counted.
fn full_log_while_events_keep_arriving(kind: Kind, model: Model) {
    let recorder = Recorder::start(kind, model);
    let mut unit = recorder.unit();
    recorder.play(&toggling(2048, 1));
    let mut cursor = None;
    let (mut entries, mut delivered, mut lost) = (Vec::new(), 0, 0);
    recorder.start_playing(&toggling(400, 2));
    let mut last = false;
    while !last {
        // One more reading after the last contact has moved finds the rest.
        last = recorder.played().len() == 2448;
        unit.read_new(&mut cursor, 2048, &mut |delivery| match delivery {
            Delivery::Event { entry, .. } => {
                entries.push(entry);
                delivered += 1;
            }
            Delivery::Lost {
                lost: Lost::Overwritten { count } | Lost::OverwrittenAtLeast { count },
                ..
            } => {
                entries.clear();
                lost += count;
            }
            Delivery::Lost { lost, .. } => {
                panic!("nobody erased the log or stopped recording: {lost:?}")
            }
        })
        .expect("the log is read");
        if !last {
            unit.wait_event(Duration::from_millis(20)).expect("the line is up");
        }
    }
    recorder.wait_played();
    let played = recorder.played();
    assert_eq!(played.len(), 2448);
    // The events delivered after the last loss are the newest ones, without a gap.
    assert_entries_are(&entries, &played[played.len() - entries.len()..]);
    assert_eq!(delivered + lost, 2448, "each event is delivered once or counted as lost");
}

fn an_overrun_log_says_exactly_how_many_are_lost(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser160);
    let mut unit = recorder.unit();
    let size = 100;
    unit.configure(Configuration { size, ..Configuration::default() }.into()).expect("configured");
    recorder.play(&toggling(20, 1));
    let mut cursor = None;
    let mut log = Vec::new();
    unit.read_new(&mut cursor, size, &mut |delivery| log.push(delivery)).expect("the log is read");
    assert_eq!(log.len(), 20);
    // Two and a half times as many events as the log holds follow.
    recorder.play(&toggling(250, 1));
    log.clear();
    let summary = unit
        .read_new(&mut cursor, size, &mut |delivery| log.push(delivery))
        .expect("the log is read");
    assert_eq!((summary.delivered, summary.lost, summary.restarted), (100, 150, false));
    assert!(matches!(log[0], Delivery::Lost { lost: Lost::Overwritten { count: 150 }, .. }));
    let entries: Vec<_> = log[1..]
        .iter()
        .map(|delivery| match delivery {
            Delivery::Event { entry, .. } => *entry,
            Delivery::Lost { lost, .. } => panic!("{lost:?}"),
        })
        .collect();
    assert_entries_are(&entries, &recorder.played()[170..]);
}

/// Four printouts of a full log, as many as may wait, while contacts move and a host reads.
fn a_full_printout_keeps_the_recorder_from_nothing(kind: Kind) {
    let recorder = Recorder::start(kind, Model::Ser320);
    let mut unit = recorder.unit();
    recorder.play(&toggling(2048, 1));
    let mut cursor = None;
    let mut entries = Vec::new();
    let mut deliver = |delivery: Delivery| match delivery {
        Delivery::Event { entry, .. } => entries.push(entry),
        Delivery::Lost { lost, .. } => panic!("{lost:?}"),
    };
    unit.read_new(&mut cursor, 2048, &mut deliver).expect("the log is read");
    for _ in 0..4 {
        unit.print(1, 2048).expect("accepted");
    }
    recorder.play(&toggling(500, 2));
    unit.read_new(&mut cursor, 2048, &mut deliver).expect("a reply goes before the lines");
    assert_entries_are(&entries, &recorder.played());
}
