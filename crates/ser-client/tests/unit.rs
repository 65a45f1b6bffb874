//! The blocking façade, against a recorder that answers at once.

mod common;

use std::io::ErrorKind;
use std::num::NonZeroU8;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use common::unit::{Answers, Bench};
use common::{Told, told};
use ser_client::{
    Change, Cursor, Diagnosis, Disturbed, LogFollower, LogPosition, Outcome, RequestError, Stage,
    Summary, TransportError, Unit, Unsolicited,
};
use ser_proto::{
    AutoReport, Baud, Capabilities, Command, Configure, Counter, Counters, Filters,
    FirmwareVersion, Guard, Identity, InputFilter, Mode, Model, Reply, TimeStamp,
};

const NOON: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 12, minute: 0, second: 0, millisecond: 0 };

fn keep_everything() -> Configure {
    Configure {
        size: None,
        baud: None,
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    }
}

fn read_new(
    unit: &mut Unit,
    cursor: &mut Option<Cursor>,
    size: u16,
) -> (Vec<Told>, Result<Summary, RequestError>) {
    let mut all = Vec::new();
    let result = unit.read_new(cursor, size, &mut |delivery| all.push(told(delivery)));
    (all, result)
}

#[test]
fn every_command_has_its_call() {
    let mut bench = Bench::new(100);
    let running = Mode { recording: true, version: 125 };
    assert_eq!(bench.unit.mode().unwrap(), running);
    assert!(!bench.unit.set_recording(false).unwrap().recording);
    assert_eq!(bench.unit.configuration().unwrap().size, 100);
    assert_eq!(bench.unit.last_broadcast().unwrap().unwrap().code, 0x45);
    bench.fake().recorder.append_many(3);
    assert_eq!(bench.unit.log_position().unwrap(), LogPosition { total: 3, next_slot: 3 });
    bench.unit.erase().unwrap();
    assert_eq!(bench.fake().recorder.held(), 0);
    assert_eq!(bench.unit.request(&Command::SetClock(NOON)).unwrap(), Reply::ClockSet);
    bench.unit.print(1, 1).unwrap();
    let line = bench.unit.wait_event(Duration::ZERO).unwrap();
    assert!(matches!(line, Some(Unsolicited::Line(line)) if line.text == "1 10:00:00.000 1 ON"));
    assert_eq!(bench.unit.wait_event(Duration::ZERO).unwrap(), None);
}

#[test]
fn settings_are_checked_against_what_is_in_force() {
    let mut bench = Bench::new(100);
    let in_force = bench
        .unit
        .configure(Configure { size: Some(50), auto_print: true, ..keep_everything() })
        .unwrap();
    assert_eq!((in_force.size, in_force.auto_print, in_force.baud), (50, true, Baud::B19200));
    assert_eq!(bench.fake().recorder.size, 50);
    // A recorder that finds a field out of range changes nothing and answers with its settings.
    let result = bench.unit.configure(Configure { size: Some(2049), ..keep_everything() });
    assert!(
        matches!(result, Err(RequestError::Refused { in_force: old }) if old == in_force),
        "{result:?}"
    );
}

#[test]
fn an_answer_from_before_the_question_is_none() {
    let mut bench = Bench::new(100);
    let running = Reply::Mode(Mode { recording: true, version: 125 });
    bench.fake().reply(&running);
    assert!(!bench.unit.set_recording(false).unwrap().recording);
    assert_eq!(bench.unit.counters().stray_replies, 1);
}

#[test]
fn the_line_follows_a_new_baud_rate() {
    let mut bench = Bench::serial(100);
    let in_force =
        bench.unit.configure(Configure { baud: Some(Baud::B9600), ..keep_everything() }).unwrap();
    assert_eq!(in_force.baud, Baud::B9600);
    assert_eq!(bench.fake().unit_rate, 9600);
    assert_eq!(bench.unit.bits_per_second(), Some(9600));
    assert!(bench.unit.mode().unwrap().recording);
}

#[test]
fn a_wrong_baud_rate_shows_as_garbage() {
    let mut bench = Bench::new(100);
    bench.unit.set_baud(9600).unwrap();
    let error = bench.unit.mode().unwrap_err();
    let RequestError::NoReply { attempts: 3, diagnosis, may_have_been_done: false, .. } = error
    else {
        panic!("{error:?}")
    };
    assert_eq!(diagnosis, Diagnosis::Garbage { bytes: 6 });
    assert!(error.hint().unwrap().contains("baud"));
    bench.unit.set_baud(19_200).unwrap();
    assert!(bench.unit.mode().unwrap().recording);
}

#[test]
fn a_unit_at_another_rate_is_found_and_the_rate_is_left_as_it_was() {
    let mut bench = Bench::serial(100);
    bench.unit.set_baud(9600).unwrap();
    assert_eq!(bench.unit.find_baud().unwrap(), Some(Baud::B19200));
    assert_eq!(bench.unit.bits_per_second(), Some(9600));
    bench.fake().commands.clear();
    bench.unit.set_baud(19_200).unwrap();
    assert!(bench.unit.mode().unwrap().recording);
    assert_eq!(
        bench.fake().commands,
        [Command::QueryMode],
        "the right rate is not asked for twice"
    );
    // Nothing is sent, because this side could not follow to the new rate.
    assert_eq!(Bench::new(100).unit.find_baud().unwrap(), None);
}

#[test]
fn a_unit_that_is_silent_at_every_rate_is_not_found() {
    let mut bench = Bench::serial(100);
    bench.fake().unit_rate = 110;
    assert_eq!(bench.unit.find_baud().unwrap(), None);
    assert_eq!(bench.unit.bits_per_second(), Some(19_200));
    bench.fake().broken = Some(ErrorKind::NotConnected);
    assert!(matches!(
        bench.unit.find_baud(),
        Err(RequestError::Transport(TransportError::Unplugged))
    ));
}

#[test]
fn lines_from_before_the_reply_to_a_print_are_not_among_its_lines() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append();
    let report = Unsolicited::Report(bench.fake().recorder.read(1, 1));
    bench.fake().say(b"1 09:00:00.000 7 ON\r\n");
    let copy = bench.fake().recorder.read(1, 1);
    bench.fake().reply(&Reply::Read(copy));
    bench.fake().say(b"2 09:00:");
    bench.unit.print(1, 1).unwrap();
    assert_eq!(bench.unit.wait_event(Duration::ZERO).unwrap(), Some(report));
    let line = bench.unit.wait_event(Duration::ZERO).unwrap();
    assert!(
        matches!(&line, Some(Unsolicited::Line(line)) if line.text == "1 10:00:00.000 1 ON"),
        "{line:?}"
    );
    assert_eq!(bench.unit.wait_event(Duration::ZERO).unwrap(), None);
}

#[test]
fn an_erase_without_reply_is_not_repeated_and_says_that_it_may_have_been_done() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append();
    bench.fake().swallow = 1;
    let error = bench.unit.erase().unwrap_err();
    assert!(matches!(
        error,
        RequestError::NoReply {
            attempts: 1,
            diagnosis: Diagnosis::Silent,
            may_have_been_done: true,
            ..
        }
    ));
    assert!(error.to_string().ends_with("it may or may not have been carried out"), "{error}");
    assert_eq!(bench.fake().commands, [Command::Erase]);
}

#[test]
fn an_original_unit_is_silent_on_the_queries() {
    let mut bench = Bench::new(100);
    bench.fake().original = true;
    for result in [bench.unit.mode().map(drop), bench.unit.configuration().map(drop)] {
        assert!(matches!(
            result,
            Err(RequestError::NoReply { attempts: 3, diagnosis: Diagnosis::Silent, .. })
        ));
    }
    assert!(bench.unit.set_recording(true).unwrap().recording);
}

#[test]
fn an_original_unit_is_asked_once_who_it_is_and_only_after_it_has_answered() {
    // One that is silent, one whose answer says nothing, and one that answers with what is no
    // answer.
    let answers: [Answers; 3] = [
        |_| None,
        |command| (*command == Command::Identify).then(|| b"I?".to_vec()),
        |command| (*command == Command::Identify).then(|| b"Z what".to_vec()),
    ];
    for beyond_the_manual in answers {
        let mut bench = Bench::new(100);
        bench.fake().original = true;
        bench.fake().beyond_the_manual = beyond_the_manual;
        assert_eq!(bench.unit.identity().unwrap(), None);
        assert_eq!(bench.unit.clock_look().unwrap(), None);
        assert_eq!(bench.unit.filters().unwrap(), None);
        assert_eq!(bench.unit.recorder_counters().unwrap(), None);
        assert_eq!(bench.unit.set_filter(None, InputFilter::OFF).unwrap(), None);
        assert_eq!(
            bench.fake().commands,
            [Command::Read { start: 1, count: 1 }, Command::Identify]
        );
        // And it is as it was before.
        assert!(bench.unit.set_recording(true).unwrap().recording);
    }
}

/// What a host does with a recorder, in this order.
const ERRANDS: [fn(&mut Unit) -> String; 9] = [
    |unit| format!("{:?}", unit.set_recording(true)),
    |unit| format!("{:?}", read_new(unit, &mut None, 100)),
    |unit| format!("{:?}", unit.set_clock(|_| NOON)),
    |unit| format!("{:?}", unit.last_broadcast()),
    |unit| format!("{:?}", unit.configure(keep_everything())),
    |unit| format!("{:?}", unit.mode()),
    |unit| format!("{:?}", unit.print(1, 1)),
    |unit| format!("{:?}", unit.log_position()),
    |unit| format!("{:?}", unit.erase()),
];

/// Everything that only our recorders can be asked, over and over.
fn ask_beyond_the_manual(unit: &mut Unit) {
    for _ in 0..3 {
        assert_eq!(unit.identity().unwrap(), None);
        assert_eq!(unit.clock_look().unwrap(), None);
        assert_eq!(unit.filters().unwrap(), None);
        assert_eq!(unit.recorder_counters().unwrap(), None);
        assert_eq!(unit.set_filter(None, InputFilter::OFF).unwrap(), None);
    }
}

/// Does all errands, and asks for more before the one of this number. Returns what came of them,
/// and the bytes that were sent.
fn errands(says: Option<&'static [u8]>, asks_before: usize) -> (Vec<String>, Vec<u8>) {
    let mut bench = Bench::in_virtual_time(100);
    bench.fake().original = true;
    bench.fake().recorder.append_many(25);
    match says {
        Some(says) => bench.fake().says_beyond_the_manual = says,
        None => bench.unit.take_for_original(),
    }
    let mut done = Vec::new();
    for (number, errand) in ERRANDS.iter().enumerate() {
        if number == asks_before {
            ask_beyond_the_manual(&mut bench.unit);
        }
        done.push(errand(&mut bench.unit));
    }
    let sent = bench.fake().sent.clone();
    (done, sent)
}

#[test]
fn an_original_unit_gets_the_bytes_of_the_manual_and_one_question_whatever_it_makes_of_that() {
    const IDENTIFY: &[u8] = b"\x1B014949";
    let (as_before, manual) = errands(None, 0);
    assert!(!manual.windows(IDENTIFY.len()).any(|bytes| bytes == IDENTIFY));
    let answers: [&[u8]; 9] = [
        b"",
        // Noise, text, a frame that does not end, and one whose checksum is wrong.
        b"\xFF\x00\x80\x7F",
        b"?SYNTAX ERROR",
        b"\x1B2149",
        b"\x1B01494A",
        // The command itself, an identity that is cut off, one of no recorder, and another reply.
        b"\x1B014949",
        b"\x1B0549011000015B",
        b"\x1B0249004952\x1B",
        b"\x1B014545",
    ];
    for says in answers {
        for asks_before in 0..ERRANDS.len() {
            let (done, mut sent) = errands(Some(says), asks_before);
            let told = String::from_utf8_lossy(says);
            assert_eq!(done, as_before, "{told:?} before errand {asks_before}");
            let at = sent.windows(IDENTIFY.len()).position(|bytes| bytes == IDENTIFY);
            let at = at.expect("it was asked");
            sent.drain(at..at + IDENTIFY.len());
            if asks_before == 0 {
                // Nothing was answered yet, so a command of the manual comes first.
                assert!(at > 0, "nothing was answered");
                sent.drain(..at);
            }
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace('\x1B', "\n");
            assert_eq!(text(&sent), text(&manual), "{told:?} before errand {asks_before}");
        }
    }
}

#[test]
fn a_unit_that_does_not_answer_the_manual_is_asked_nothing_else() {
    let mut bench = Bench::new(100);
    bench.fake().swallow = usize::MAX;
    assert!(matches!(bench.unit.identity(), Err(RequestError::NoReply { .. })));
    let read = Command::Read { start: 1, count: 1 };
    assert!(bench.fake().commands.iter().all(|command| *command == read));
}

#[test]
fn one_that_is_known_to_be_original_is_not_even_asked_once() {
    let mut bench = Bench::new(100);
    bench.unit.take_for_original();
    assert_eq!(bench.unit.identity().unwrap(), None);
    assert_eq!(bench.fake().commands, []);
}

#[test]
fn a_unit_of_ours_is_asked_for_all_its_filters_and_counters() {
    let mut bench = Bench::new(100);
    bench.fake().beyond_the_manual = |command| {
        let filter = |input: u8| InputFilter { debounce_ms: input, chatter: None };
        let reply = match *command {
            Command::Identify => Reply::Identity(Identity {
                level: 1,
                model: Model::Ser320,
                firmware: FirmwareVersion { major: 1, minor: 0, patch: 0 },
                capabilities: Capabilities::FILTERS.with(Capabilities::DIAGNOSTICS),
                id: None,
                power_ups: 1,
                life: 1,
                log_capacity: 2048,
                guard: Guard::None,
            }),
            Command::QueryFilters { first } => {
                let inputs = first.get()..=32;
                Reply::Filters(Filters { first, filters: inputs.take(20).map(filter).collect() })
            }
            Command::Diagnostics { first } if first == Counter::FIRST => {
                let next = Counter::suppressed(1);
                Reply::Diagnostics(Counters { first, next, values: [7, 8].into_iter().collect() })
            }
            Command::Diagnostics { first } => Reply::Diagnostics(Counters {
                first,
                next: None,
                values: [9].into_iter().collect(),
            }),
            _ => return None,
        };
        Some(reply.to_body().to_vec())
    };
    let filters = bench.unit.filters().unwrap().unwrap();
    assert_eq!(
        filters.iter().map(|filter| filter.debounce_ms).collect::<Vec<_>>(),
        (1..=32).collect::<Vec<_>>()
    );
    let values: Vec<u32> =
        bench.unit.recorder_counters().unwrap().unwrap().iter().map(|counter| counter.1).collect();
    assert_eq!(values, [7, 8, 9]);
    assert_eq!(bench.unit.suppressed_changes().unwrap(), Some(vec![(1, 9)]));
    assert_eq!(bench.unit.clock_look().unwrap(), None, "it has not said that it can");
}

#[test]
fn a_filter_that_is_not_in_force_afterwards_was_refused() {
    let mut bench = Bench::new(100);
    bench.fake().beyond_the_manual = |command| {
        let reply = match *command {
            Command::Identify => Reply::Identity(Identity {
                level: 1,
                model: Model::Ser160,
                firmware: FirmwareVersion { major: 1, minor: 0, patch: 0 },
                capabilities: Capabilities::FILTERS,
                id: None,
                power_ups: 1,
                life: 1,
                log_capacity: 2048,
                guard: Guard::None,
            }),
            // It takes nothing for input 2, and has no input 17.
            Command::SetFilter { input, filter } => {
                let first = input.unwrap_or(NonZeroU8::MIN);
                let in_force = |number| if number == 2 { InputFilter::OFF } else { filter };
                let filters = (first.get()..=16).map(in_force).collect();
                Reply::Filters(Filters { first, filters })
            }
            _ => return None,
        };
        Some(reply.to_body().to_vec())
    };
    let changes = heard(&mut bench.unit);
    let filter = InputFilter { debounce_ms: 5, chatter: None };
    let input = NonZeroU8::new;
    assert_eq!(bench.unit.set_filter(input(1), filter).unwrap().unwrap().first.get(), 1);
    for input in [input(2), None] {
        let refused = bench.unit.set_filter(input, filter).unwrap_err();
        assert!(
            matches!(refused, RequestError::FilterRefused { input: 2, in_force: InputFilter::OFF }),
            "{refused}"
        );
    }
    let beyond = bench.unit.set_filter(input(17), filter).unwrap_err();
    assert!(matches!(beyond, RequestError::UnexpectedReply { .. }), "{beyond}");
    let changes: Vec<_> =
        changes.try_iter().map(|(change, outcome)| (change.to_string(), outcome)).collect();
    let has = "input 2 has: debounce off, chatter filter off".to_owned();
    let what = |which| format!("set filter of {which}: debounce 5 ms, chatter filter off");
    assert_eq!(changes[0], (what("input 1"), Outcome::Done));
    assert_eq!(changes[1], (what("input 2"), Outcome::Refused(has.clone())));
    assert_eq!(changes[2], (what("all inputs"), Outcome::Refused(has)));
    assert_eq!(changes[3].0, what("input 17"));
    assert!(matches!(changes[3].1, Outcome::NotAnswered(_)), "{:?}", changes[3]);
}

#[test]
fn the_clock_is_asked_for_the_time_of_each_attempt() {
    let mut bench = Bench::serial(100);
    bench.fake().swallow = 2;
    let mut delays = Vec::new();
    let set = bench
        .unit
        .set_clock(|delay| {
            delays.push(delay);
            TimeStamp { second: u8::try_from(delays.len()).unwrap(), ..NOON }
        })
        .unwrap();
    assert_eq!(set, TimeStamp { second: 3, ..NOON });
    let on_the_line = Duration::from_nanos(230 * 1_000_000_000 / 19_200);
    assert_eq!(delays, [on_the_line, on_the_line, on_the_line]);
    let sent = [1, 2, 3].map(|second| Command::SetClock(TimeStamp { second, ..NOON }));
    assert_eq!(bench.fake().commands, sent);
}

#[test]
fn a_time_that_does_not_exist_is_not_sent() {
    let mut bench = Bench::new(100);
    let error = bench.unit.set_clock(|_| TimeStamp { day: 31, ..NOON }).unwrap_err();
    assert!(matches!(error, RequestError::InvalidTime(_)));
    assert!(bench.fake().commands.is_empty());
}

#[test]
fn a_log_is_read_over_a_line_that_loses_replies() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append_many(130);
    let mut cursor = None;
    bench.fake().swallow = 1;
    let (all, result) = read_new(&mut bench.unit, &mut cursor, 100);
    assert_eq!(all[0], Told::AtLeast(30));
    assert_eq!(all[1..], (31..=130).map(Told::Event).collect::<Vec<_>>());
    let position = LogPosition { total: 130, next_slot: 30 };
    assert_eq!(
        result.unwrap(),
        Summary { unrecorded: 0, delivered: 100, lost: 30, restarted: false, position }
    );
    assert_eq!(cursor.unwrap().total(), 130);
    // A second reading with nothing new is one request.
    bench.fake().commands.clear();
    assert_eq!(read_new(&mut bench.unit, &mut cursor, 100).0, []);
    assert_eq!(bench.fake().commands.len(), 1);
    // What comes then is read from there.
    bench.fake().recorder.append_many(2);
    assert_eq!(read_new(&mut bench.unit, &mut cursor, 100).0, [Told::Event(131), Told::Event(132)]);
}

#[test]
fn two_reads_are_under_way_unless_the_unit_hears_only_one() {
    for deaf_when_talking in [false, true] {
        let mut bench = Bench::new(100);
        bench.fake().recorder.append_many(100);
        bench.fake().deaf_when_talking = deaf_when_talking;
        let (all, result) = read_new(&mut bench.unit, &mut None, 100);
        assert_eq!(all, (1..=100).map(Told::Event).collect::<Vec<_>>());
        assert_eq!(result.unwrap().delivered, 100);
        assert_eq!(bench.unit.reads_one_at_a_time(), deaf_when_talking);
    }
}

#[test]
fn a_reading_that_fails_goes_on_where_it_stopped() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append_many(100);
    let mut cursor = None;
    let mut all = Vec::new();
    let mut failures = 0;
    loop {
        bench.fake().breaks_in = Some(4);
        let (told, result) = read_new(&mut bench.unit, &mut cursor, 100);
        all.extend(told);
        bench.fake().broken = None;
        match result {
            Ok(_) => break,
            Err(RequestError::Transport(TransportError::Unplugged)) => failures += 1,
            Err(error) => panic!("{error:?}"),
        }
    }
    assert_eq!(all, (1..=100).map(Told::Event).collect::<Vec<_>>());
    assert!(failures > 2);
}

#[test]
fn a_log_that_is_resized_under_the_reading_is_read_to_its_end() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append_many(100);
    bench.fake().meanwhile = Box::new(|recorder, configuration, commands| {
        if commands == 5 {
            recorder.append_many(3);
            recorder.resize(90);
            configuration.size = 90;
        }
    });
    let mut cursor = None;
    let (all, result) = read_new(&mut bench.unit, &mut cursor, 100);
    assert_eq!(result.unwrap().delivered, 103);
    assert_eq!(all, (1..=103).map(Told::Event).collect::<Vec<_>>());
    assert!(bench.fake().commands.contains(&Command::QueryConfiguration));
}

#[test]
fn a_log_that_never_rests_ends_in_an_error() {
    let mut bench = Bench::new(99);
    bench.fake().recorder.append_many(150);
    bench.fake().meanwhile = Box::new(|recorder, _, _| {
        recorder.erase();
        recorder.append_many(150);
    });
    // Every total is the same but every entry different, so each reading sees a new log.
    let mut cursor = None;
    let (_, result) = read_new(&mut bench.unit, &mut cursor, 99);
    assert!(matches!(result, Err(RequestError::Disturbed(Disturbed::Changed))), "{result:?}");
}

#[test]
fn a_size_that_is_wrong_is_corrected_if_the_unit_tells_it() {
    for original in [false, true] {
        let mut bench = Bench::new(30);
        bench.fake().recorder.append_many(30);
        bench.fake().original = original;
        let (all, result) = read_new(&mut bench.unit, &mut None, 20);
        if original {
            assert!(
                matches!(result, Err(RequestError::Disturbed(Disturbed::WrongSize))),
                "{result:?}"
            );
            assert_eq!(all, []);
        } else {
            assert_eq!(result.unwrap().delivered, 30);
        }
    }
}

#[test]
fn entries_are_read_by_their_numbers() {
    let mut bench = Bench::new(30);
    bench.fake().recorder.append_many(35);
    let mut read = |start, count| {
        let mut all = Vec::new();
        let number = bench
            .unit
            .read_range(start, count, 30, &mut |delivery| all.push(told(delivery)))
            .unwrap();
        assert_eq!(usize::from(number), all.len());
        all
    };
    assert_eq!(read(1, 2), [Told::Event(31), Told::Event(32)]);
    assert_eq!(read(5, 12), [35].into_iter().chain(6..=16).map(Told::Event).collect::<Vec<_>>());
    assert_eq!(read(29, 100), [Told::Event(29), Told::Event(30)]);
    assert_eq!(read(0, 10), []);
    assert_eq!(read(31, 10), []);
    assert_eq!(read(u16::MAX, u16::MAX), []);
    assert_eq!(read(1, 0), []);
}

#[test]
fn a_range_ends_where_the_log_ends_and_short_replies_go_on() {
    let mut bench = Bench::new(30);
    bench.fake().recorder.append_many(18);
    bench.fake().recorder.reply_limit = 7;
    let mut all = Vec::new();
    assert_eq!(
        bench.unit.read_range(1, 30, 30, &mut |delivery| all.push(told(delivery))).unwrap(),
        18
    );
    assert_eq!(all, (1..=18).map(Told::Event).collect::<Vec<_>>());
}

#[test]
fn reports_and_lines_during_requests_are_kept_in_order() {
    let mut bench = Bench::new(30);
    bench.fake().recorder.append();
    let report = bench.fake().recorder.read(1, 1);
    bench.fake().say(b"a line from before\r\n");
    bench.fake().reply(&Reply::Read(report.clone()));
    // The report would be a valid answer, but it came before the question.
    assert_eq!(bench.unit.log_position().unwrap().total, 1);
    assert_eq!(bench.fake().commands.len(), 1);
    let mut next = || bench.unit.wait_event(Duration::ZERO).unwrap();
    assert!(matches!(next(), Some(Unsolicited::Line(line)) if line.text == "a line from before"));
    assert_eq!(next(), Some(Unsolicited::Report(report)));
    assert_eq!(next(), None);
    assert_eq!(bench.unit.unsolicited_dropped(), 0);
    assert_eq!(bench.unit.counters().reports, 1);
}

#[test]
fn a_line_that_breaks_says_how_and_can_be_used_again() {
    let mut bench = Bench::new(30);
    bench.fake().broken = Some(ErrorKind::NotConnected);
    let error = bench.unit.mode().unwrap_err();
    assert!(matches!(error, RequestError::Transport(TransportError::Unplugged)), "{error:?}");
    bench.fake().broken = Some(ErrorKind::ConnectionReset);
    let error = bench.unit.wait_event(Duration::from_secs(1)).unwrap_err();
    assert!(matches!(error, RequestError::Transport(TransportError::Closed)), "{error:?}");
    bench.fake().broken = None;
    assert!(bench.unit.mode().unwrap().recording);
}

#[test]
fn a_reading_says_by_when_there_was_nothing_else() {
    let mut bench = Bench::new(100);
    bench.fake().recorder.append_many(25);
    let mut follower = LogFollower::new(None, 100);
    assert_eq!(follower.complete_at(), None);
    let mut read = |bench: &mut Bench| {
        let before = bench.unit.now();
        let mut events = 0;
        follower
            .read_new(&mut bench.unit, &mut |step| -> Result<(), RequestError> {
                events += step.deliveries.len();
                Ok(())
            })
            .unwrap();
        (before, events, follower.complete_at().unwrap())
    };
    let (before, events, complete_at) = read(&mut bench);
    let last = bench.unit.last_exchange().unwrap();
    let delay = bench.unit.report_delay();
    let told_of = last.first_sent.saturating_sub(delay);
    assert_eq!((events, complete_at), (25, told_of), "all that the last reply told of");
    assert!(before.saturating_sub(delay) <= complete_at);
    // Events are added after each answer, so there is always more than the reading has passed.
    bench.fake().meanwhile = Box::new(|recorder, _, _| recorder.append_many(1));
    bench.fake().recorder.append_many(3);
    let (before, _, complete_at) = read(&mut bench);
    let last = bench.unit.last_exchange().unwrap();
    assert!(before.saturating_sub(delay) <= complete_at && complete_at <= last.answered);
}

/// Every change by this connection with its outcome. Each was told before as one that begins.
fn heard(unit: &mut Unit) -> Receiver<(Change, Outcome)> {
    let (told, heard) = channel();
    let mut begun: Option<Change> = None;
    unit.on_change(Box::new(move |change, stage| match stage {
        Stage::Begins => assert_eq!(begun.replace(*change), None, "one after the other"),
        Stage::Ended(outcome) => {
            let begun = begun.take().expect("it has begun");
            let sets_clock = |change: &Change| matches!(change, Change::SetClock(_));
            assert!(begun == *change || sets_clock(&begun) && sets_clock(change), "{begun}");
            told.send((*change, outcome.clone())).unwrap();
        }
    }));
    heard
}

#[test]
fn a_change_is_told_before_anything_of_it_is_sent() {
    let mut bench = Bench::new(100);
    let (told, heard) = channel();
    bench.unit.on_change(Box::new(move |_, stage| {
        if stage == Stage::Begins {
            told.send(()).unwrap();
        }
    }));
    let heard = std::sync::Mutex::new(heard);
    bench.fake().meanwhile = Box::new(move |_, _, _| {
        assert!(heard.lock().unwrap().try_recv().is_ok(), "a command that nobody was told of");
    });
    bench.unit.erase().unwrap();
    bench.unit.set_clock(|_| NOON).unwrap();
    bench.unit.configure(keep_everything()).unwrap();
}

#[test]
fn each_change_is_told_once_with_its_outcome_and_nothing_else_is() {
    let mut bench = Bench::new(100);
    let changes = heard(&mut bench.unit);
    bench.fake().recorder.append_many(3);
    bench.unit.mode().unwrap();
    bench.unit.configuration().unwrap();
    bench.unit.last_broadcast().unwrap();
    bench.unit.log_position().unwrap();
    bench.unit.print(1, 1).unwrap();
    read_new(&mut bench.unit, &mut None, 100).1.unwrap();
    assert_eq!(changes.try_iter().next(), None, "whoever only asks changes nothing");

    bench.unit.set_recording(false).unwrap();
    let settings = Configure { size: Some(50), ..keep_everything() };
    bench.unit.configure(settings).unwrap();
    bench.unit.set_clock(|_| NOON).unwrap();
    bench.unit.erase().unwrap();
    bench.unit.request(&Command::SetMode { recording: true }).unwrap();
    let done = [
        Change::SetRecording(false),
        Change::Configure(settings),
        Change::SetClock(NOON),
        Change::Erase,
        Change::SetRecording(true),
    ];
    assert_eq!(changes.try_iter().collect::<Vec<_>>(), done.map(|change| (change, Outcome::Done)));
}

#[test]
fn what_was_repeated_is_one_change_and_has_the_time_that_was_sent_last() {
    let mut bench = Bench::new(100);
    let changes = heard(&mut bench.unit);
    bench.fake().swallow = 2;
    let mut second = 0;
    bench
        .unit
        .set_clock(|_| {
            second += 1;
            TimeStamp { second, ..NOON }
        })
        .unwrap();
    assert_eq!(bench.fake().commands.len(), 3);
    let set = Change::SetClock(TimeStamp { second: 3, ..NOON });
    assert_eq!(changes.try_iter().collect::<Vec<_>>(), [(set, Outcome::Done)]);
}

#[test]
fn an_outcome_tells_what_is_not_known_from_what_was_refused_and_what_was_never_sent() {
    let mut bench = Bench::new(100);
    let changes = heard(&mut bench.unit);
    let last = || {
        let all: Vec<_> = changes.try_iter().collect();
        let [(change, outcome)] = &all[..] else { panic!("{all:?}") };
        (change.to_string(), outcome.clone())
    };
    bench.fake().swallow = 1;
    assert!(bench.unit.erase().is_err());
    let (change, outcome) = last();
    assert_eq!(change, "erase the log");
    assert!(
        matches!(&outcome, Outcome::NotAnswered(why) if why.contains("no answer")),
        "{outcome:?}"
    );

    let result = bench.unit.configure(Configure { size: Some(2049), ..keep_everything() });
    assert!(result.is_err());
    let in_force = "in force are size 100 entries, line 19200 baud, auto report off, report to 0, \
                    auto print off";
    assert_eq!(last().1, Outcome::Refused(in_force.to_owned()));

    let no_day = TimeStamp { day: 31, ..NOON };
    assert!(bench.unit.set_clock(|_| no_day).is_err());
    let (change, outcome) = last();
    assert_eq!(change, "set clock");
    assert!(matches!(outcome, Outcome::NotSent(_)), "{outcome:?}");

    bench.fake().breaks_in = Some(0);
    assert!(bench.unit.set_recording(false).is_err());
    assert!(matches!(last().1, Outcome::NotAnswered(why) if why == "the serial port is gone"));
    assert!(bench.unit.erase().is_err());
    assert!(matches!(last().1, Outcome::NotSent(why) if why == "the serial port is gone"));
}
