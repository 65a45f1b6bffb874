//! Requests and their answers, with every byte and every moment given.

mod common;

use std::num::NonZeroU8;
use std::time::Duration;

use common::Recorder;
use proptest::prelude::*;
use ser_client::{Busy, Diagnosis, LineRate, NoReply, Session, TextLine, Timing, Unsolicited};
use ser_proto::{
    AutoReport, Baud, ClockReading, ClockSource, Code, Command, Configure, Counter, Counters,
    Filters, FrameEncoder, InputFilter, Mode, ParseError, ReadReply, Reply, TimeStamp,
};

const TIMEOUT: Duration = Duration::from_secs(1);
const RUNNING: Reply = Reply::Mode(Mode { recording: true, version: 125 });

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A line that takes no time: an attempt lasts exactly the timeout.
fn session(retries: u32) -> Session {
    Session::new(Timing { timeout: TIMEOUT, retries, line_rate: LineRate::Instant })
}

fn frame(reply: &Reply) -> Vec<u8> {
    FrameEncoder::new(reply.to_body()).collect()
}

/// The bytes that the session sends now.
fn sent(session: &mut Session, now: Duration) -> Option<Vec<u8>> {
    session.dispatch(now).map(|attempt| attempt.frame().to_vec())
}

/// A read reply with the entries that `count` asks for.
fn read_reply(start: u16, count: u8) -> ReadReply {
    let mut recorder = Recorder::new(20);
    recorder.append_many(30);
    recorder.read(start, count)
}

fn no_reply(
    command: Code,
    attempts: u32,
    diagnosis: Diagnosis,
    may_have_been_done: bool,
) -> NoReply {
    NoReply { command, attempts, diagnosis, may_have_been_done }
}

#[test]
fn a_request_goes_out_at_once_and_its_answer_comes_back() {
    let mut session = session(2);
    assert_eq!(session.poll_at(), None);
    assert_eq!(sent(&mut session, ms(0)), None);
    session.request(Command::Read { start: 500, count: 5 }).unwrap();
    assert!(session.poll_at().unwrap() <= ms(10));
    assert_eq!(sent(&mut session, ms(10)).unwrap(), b"\x1B045201F4054C");
    assert_eq!(session.poll_at(), Some(ms(1010)));
    assert_eq!(sent(&mut session, ms(11)), None);
    assert_eq!(session.take_answer(), None);
    let reply = Reply::Read(ReadReply { start: 500, ..read_reply(1, 5) });
    session.process(ms(50), &frame(&reply));
    assert_eq!(session.take_answer(), Some(Ok(reply)));
    assert_eq!(session.take_answer(), None);
    assert_eq!(session.poll_at(), None);
}

#[test]
fn a_body_without_a_frame_is_a_message_like_any_other() {
    let mut session = session(0);
    session.request(Command::Read { start: 1, count: 10 }).unwrap();
    assert_eq!(session.dispatch(ms(0)).unwrap().command(), &Command::Read { start: 1, count: 10 });
    // Over a Genius bus a recorder with 32 inputs returns seven entries when ten were asked for.
    let (report, reply) = (read_reply(5, 2), read_reply(1, 7));
    session.process_body(ms(1), &Reply::Read(report.clone()).to_body());
    session.process_body(ms(1), b"R");
    session.process_body(ms(1), &[]);
    assert_eq!(session.take_answer(), None);
    session.process_body(ms(2), &Reply::Read(reply.clone()).to_body());
    assert_eq!(session.take_answer(), Some(Ok(Reply::Read(reply))));
    assert_eq!(session.take_unsolicited(), Some(Unsolicited::Report(report)));
    assert_eq!((session.counters().frames, session.counters().not_understood), (4, 2));
}

#[test]
fn one_request_at_a_time() {
    let mut session = session(0);
    session.request(Command::Erase).unwrap();
    assert_eq!(session.request(Command::Erase), Err(Busy));
    sent(&mut session, ms(0)).unwrap();
    session.process(ms(1), &frame(&Reply::Erased));
    assert_eq!(session.request(Command::Erase), Err(Busy), "the answer has not been taken");
    assert_eq!(session.take_answer(), Some(Ok(Reply::Erased)));
    session.request(Command::Erase).unwrap();
}

#[test]
fn the_answer_may_arrive_in_any_pieces() {
    let reply = Reply::Read(read_reply(3, 4));
    let bytes = frame(&reply);
    for cut in 0..=bytes.len() {
        let mut session = session(0);
        session.request(Command::Read { start: 3, count: 4 }).unwrap();
        sent(&mut session, ms(0)).unwrap();
        session.process(ms(1), &bytes[..cut]);
        assert_eq!(session.take_answer().is_some(), cut == bytes.len());
        if cut < bytes.len() {
            session.process(ms(2), &bytes[cut..]);
            assert_eq!(session.take_answer(), Some(Ok(reply.clone())));
        }
    }
}

#[test]
fn an_unanswered_query_is_repeated_and_then_given_up() {
    let mut session = session(2);
    session.request(Command::QueryMode).unwrap();
    for at in [0, 1000, 2000] {
        assert_eq!(sent(&mut session, ms(at)).unwrap(), b"\x1B014D4D", "at {at}");
        assert_eq!(sent(&mut session, ms(at + 999)), None);
    }
    assert_eq!(sent(&mut session, ms(3000)), None);
    assert_eq!(session.take_answer(), Some(Err(no_reply(Code::Mode, 3, Diagnosis::Silent, false))));
}

#[test]
fn what_must_not_be_done_twice_is_sent_once() {
    let change_rate = Configure {
        size: None,
        baud: Some(Baud::B300),
        auto_report: AutoReport::Off,
        report_address: 0,
        auto_print: false,
    };
    let time =
        TimeStamp { year: 26, month: 1, day: 2, hour: 3, minute: 4, second: 5, millisecond: 6 };
    for (command, attempts) in [
        (Command::Erase, 1),
        (Command::Print { start: 1, count: 9 }, 1),
        (Command::Configure(change_rate), 1),
        (Command::SetClock(time), 1),
        (Command::Configure(Configure { baud: None, ..change_rate }), 3),
        (Command::SetMode { recording: false }, 3),
    ] {
        let mut session = session(2);
        session.request(command).unwrap();
        let frames =
            (0..20).filter(|&second| sent(&mut session, ms(second * 1000)).is_some()).count();
        assert_eq!(frames, attempts, "{command:?}");
        let given_up = session.take_answer().unwrap().unwrap_err();
        assert!(given_up.may_have_been_done, "{command:?}");
    }
}

#[test]
fn what_only_asks_once_is_sent_once_and_changes_nothing() {
    let (first, counter) = (NonZeroU8::MIN, Counter::FIRST);
    let setting = Command::SetFilter { input: None, filter: InputFilter::OFF };
    for (command, attempts, changes) in [
        (Command::Identify, 1, false),
        (Command::Time { token: 7 }, 1, false),
        (Command::QueryFilters { first }, 3, false),
        (setting, 3, true),
        (Command::Diagnostics { first: counter }, 3, false),
    ] {
        let mut session = session(2);
        session.request(command).unwrap();
        let frames =
            (0..20).filter(|&second| sent(&mut session, ms(second * 1000)).is_some()).count();
        assert_eq!(frames, attempts, "{command:?}");
        let given_up = session.take_answer().unwrap().unwrap_err();
        assert_eq!(given_up.may_have_been_done, changes, "{command:?}");
    }
}

#[test]
fn a_reply_of_the_extension_answers_its_own_question_only() {
    let input = |number| NonZeroU8::new(number).unwrap();
    let filters = |first| Reply::Filters(Filters { first: input(first), filters: [].into() });
    let counters = |id| {
        let first = Counter::from_id(input(id));
        Reply::Diagnostics(Counters { first, next: None, values: [].into() })
    };
    let setting = |input| Command::SetFilter { input, filter: InputFilter::OFF };
    let from = |id| Command::Diagnostics { first: Counter::from_id(input(id)) };
    for (question, late, answer) in [
        (Command::Time { token: 2 }, reading(1), reading(2)),
        (Command::QueryFilters { first: input(17) }, filters(1), filters(17)),
        (setting(Some(input(3))), filters(1), filters(3)),
        (setting(None), filters(3), filters(1)),
        (from(20), counters(1), counters(20)),
        // The recorder has none of the ids 20 to 31.
        (from(20), counters(1), counters(32)),
    ] {
        let mut session = session(0);
        session.request(question).unwrap();
        sent(&mut session, ms(0)).unwrap();
        session.process(ms(1), &frame(&late));
        assert_eq!(session.take_answer(), None, "{question:?}");
        session.process(ms(2), &frame(&answer));
        assert_eq!(session.take_answer(), Some(Ok(answer)), "{question:?}");
    }
}

/// The answer to a `T` with this token.
fn reading(token: u16) -> Reply {
    Reply::Time(ClockReading {
        token,
        clock_us: 0,
        source: ClockSource::NeverSet,
        age_s: 0,
        doubt_us: None,
        drift_ppb: None,
        tick_us: 0,
        life: 1,
        next_sequence: 1,
        last_mark: None,
    })
}

#[test]
fn each_attempt_to_set_the_clock_has_its_own_time() {
    let rate = LineRate::BitsPerSecond(300);
    let mut session = Session::new(Timing { timeout: TIMEOUT, retries: 1, line_rate: rate });
    session.request_set_clock().unwrap();
    let mut frames = Vec::new();
    for (now, millisecond) in [(0, 1), (30_000, 2)] {
        let mut attempt = session.dispatch(ms(now)).unwrap();
        assert!(attempt.wants_time());
        // ESC, length, nine bytes and the checksum are 23 characters of ten bits.
        assert_eq!(attempt.duration(), Duration::from_nanos(766_666_666));
        attempt.set_time(TimeStamp {
            year: 26,
            month: 1,
            day: 1,
            hour: 0,
            minute: 0,
            second: 0,
            millisecond,
        });
        frames.push(String::from_utf8(attempt.frame()[1..].to_vec()).unwrap());
    }
    assert_eq!(frames, ["09531A0101000000000170", "09531A0101000000000271"]);
    session.process(ms(31_000), &frame(&Reply::ClockSet));
    assert_eq!(session.take_answer(), Some(Ok(Reply::ClockSet)));
}

#[test]
fn a_slow_line_is_given_the_time_it_needs() {
    let at = |bits_per_second, command| {
        Timing { timeout: TIMEOUT, retries: 0, line_rate: LineRate::BitsPerSecond(bits_per_second) }
            .attempt(&command)
    };
    // A frame of 13 characters and two of 341: the one that was just being sent, and the answer.
    let read = Command::Read { start: 1, count: 10 };
    assert_eq!(at(300, read), TIMEOUT + Duration::from_nanos(695 * 10 * 1_000_000_000 / 300));
    assert_eq!(at(9600, read).as_millis(), 1723);
    assert!(at(9600, Command::QueryMode) < at(9600, read));
}

#[test]
fn an_attempt_is_not_given_up_in_the_middle_of_a_frame() {
    let mut session = session(0);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(0)).unwrap();
    let bytes = frame(&RUNNING);
    // One character every 900 ms, which no line has, but a terminal server might.
    for (index, byte) in bytes.iter().enumerate() {
        let now = ms(900 * (1 + u64::try_from(index).unwrap()));
        assert_eq!(sent(&mut session, now), None);
        session.process(now, &[*byte]);
    }
    assert_eq!(session.take_answer(), Some(Ok(RUNNING)));
}

#[test]
fn a_frame_that_never_ends_does_not_hold_the_session() {
    let mut session = session(0);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(0)).unwrap();
    let mut now = 0;
    while session.take_answer().is_none() {
        now += 500;
        assert!(now < 20_000);
        session.process(ms(now), if now % 3000 == 0 { b"\x1B" } else { b"0" });
        assert_eq!(sent(&mut session, ms(now)), None);
    }
}

#[test]
fn noise_and_reports_and_lines_before_the_answer_do_not_matter() {
    let report = read_reply(7, 1);
    let mut session = session(0);
    session.request(Command::Read { start: 1, count: 10 }).unwrap();
    sent(&mut session, ms(0)).unwrap();
    let answer = Reply::Read(read_reply(1, 10));
    let mut bytes = b"\xFF\x00 7 10:00:00.250\r\n".to_vec();
    bytes.extend(frame(&Reply::Read(report.clone())));
    bytes.extend(b"\x1B0345"); // cut off by the next frame
    bytes.extend(b"\x1B014546"); // wrong checksum
    bytes.extend(frame(&Reply::Erased)); // nobody asked
    bytes.extend(frame(&answer));
    bytes.extend(b"second line\r\n");
    session.process(ms(5), &bytes);
    assert_eq!(session.take_answer(), Some(Ok(answer)));
    assert_eq!(
        session.take_unsolicited(),
        Some(Unsolicited::Line(TextLine {
            text: " 7 10:00:00.250".to_owned(),
            cut: false,
            noise: 2
        }))
    );
    assert_eq!(session.take_unsolicited(), Some(Unsolicited::Report(report)));
    // The remains of the two broken frames count against the line that they are in.
    assert_eq!(
        session.take_unsolicited(),
        Some(Unsolicited::Line(TextLine { text: "second line".to_owned(), cut: false, noise: 2 }))
    );
    assert_eq!(session.take_unsolicited(), None);
    let counters = session.counters();
    assert_eq!((counters.noise, counters.bad_checksums, counters.broken_frames), (2, 1, 1));
    assert_eq!((counters.reports, counters.stray_replies, counters.frames), (1, 1, 3));
}

#[test]
fn a_read_is_answered_by_what_it_asked_for_only() {
    let mut session = session(0);
    session.request(Command::Read { start: 4, count: 2 }).unwrap();
    // Before the request is sent nothing can be its answer.
    session.process(ms(0), &frame(&Reply::Read(read_reply(4, 2))));
    sent(&mut session, ms(0)).unwrap();
    for other in [read_reply(5, 2), read_reply(4, 3), read_reply(3, 1)] {
        session.process(ms(1), &frame(&Reply::Read(other)));
        assert_eq!(session.take_answer(), None);
    }
    // Fewer entries than asked for are an answer, because the log ends.
    session.process(ms(2), &frame(&Reply::Read(read_reply(4, 1))));
    assert_eq!(session.take_answer(), Some(Ok(Reply::Read(read_reply(4, 1)))));
    assert_eq!(session.counters().reports, 4);
}

#[test]
fn a_late_answer_to_a_request_that_was_given_up_is_not_taken_for_the_next_one() {
    let mut session = session(0);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(0)).unwrap();
    assert_eq!(sent(&mut session, ms(1000)), None);
    session.take_answer().unwrap().unwrap_err();
    // The same kind of request waits for the late answer, at most a timeout long.
    session.request(Command::SetMode { recording: false }).unwrap();
    assert_eq!(sent(&mut session, ms(1000)), None);
    assert_eq!(session.poll_at(), Some(ms(2000)));
    session.process(ms(1500), &frame(&RUNNING));
    assert_eq!(session.take_answer(), None);
    assert_eq!(sent(&mut session, ms(1500)).unwrap(), b"\x1B034D00004D");
    let stopped = Reply::Mode(Mode { recording: false, version: 125 });
    session.process(ms(1600), &frame(&stopped));
    assert_eq!(session.take_answer(), Some(Ok(stopped)));
}

#[test]
fn a_request_of_another_kind_need_not_wait() {
    let mut session = session(0);
    session.request(Command::Read { start: 1, count: 1 }).unwrap();
    sent(&mut session, ms(0)).unwrap();
    assert_eq!(sent(&mut session, ms(1000)), None);
    session.take_answer().unwrap().unwrap_err();
    session.request(Command::Read { start: 2, count: 1 }).unwrap();
    sent(&mut session, ms(1000)).unwrap();
    session.process(ms(1001), &frame(&Reply::Read(read_reply(1, 1))));
    assert_eq!(session.take_answer(), None);
    session.process(ms(1002), &frame(&Reply::Read(read_reply(2, 1))));
    assert_eq!(session.take_answer(), Some(Ok(Reply::Read(read_reply(2, 1)))));
}

#[test]
fn the_second_answer_to_a_repeated_request_is_waited_for() {
    let mut session = session(1);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(0)).unwrap();
    sent(&mut session, ms(1000)).unwrap();
    // The first attempt is answered late; the answer to the second is still to come.
    session.process(ms(1100), &frame(&RUNNING));
    assert_eq!(session.take_answer(), Some(Ok(RUNNING)));
    session.request(Command::QueryMode).unwrap();
    assert_eq!(sent(&mut session, ms(1100)), None);
    session.process(ms(1200), &frame(&RUNNING));
    assert_eq!(session.take_answer(), None);
    sent(&mut session, ms(1200)).unwrap();
    // If it never comes, the wait ends when the attempt would have ended.
    session.process(ms(1300), &frame(&RUNNING));
    session.take_answer().unwrap().unwrap();
    session.request(Command::QueryMode).unwrap();
    assert!(sent(&mut session, ms(1300)).is_some(), "nothing is owed any more");
}

#[test]
fn what_came_instead_of_an_answer_is_the_diagnosis() {
    let damaged: Vec<u8> =
        frame(&RUNNING).iter().map(|&byte| if byte == b'7' { b'6' } else { byte }).collect();
    let mut odd_length = b"\x1B024D014E".to_vec();
    odd_length.extend(frame(&Reply::ClockSet));
    // 9600 baud seen at 19200: no byte keeps its value.
    let garbage: Vec<u8> = (0..200_u8).map(|n| n.wrapping_mul(37) | 0x80).collect();
    let cases: [(&[u8], Diagnosis); 7] = [
        (b"", Diagnosis::Silent),
        (&garbage, Diagnosis::Garbage { bytes: 200 }),
        (b"\x00", Diagnosis::Garbage { bytes: 1 }),
        (&damaged, Diagnosis::Damaged { frames: 1 }),
        (&odd_length, Diagnosis::NotUnderstood(ParseError::WrongLength { code: 0x4D, length: 2 })),
        (b"12 10:00:00.250\r\n\xFF", Diagnosis::Ignored { frames: 0, lines: 1 }),
        (b"\x1B015353", Diagnosis::Ignored { frames: 1, lines: 0 }),
    ];
    for (bytes, diagnosis) in cases {
        let mut session = session(0);
        // What came earlier says nothing about this request.
        session.process(ms(0), b"an old line\r\n");
        session.request(Command::QueryMode).unwrap();
        sent(&mut session, ms(0)).unwrap();
        session.process(ms(1), bytes);
        let at = session.poll_at().unwrap();
        assert_eq!(sent(&mut session, at), None);
        assert_eq!(
            session.take_answer(),
            Some(Err(no_reply(Code::Mode, 1, diagnosis, false))),
            "{bytes:02X?}"
        );
    }
}

#[test]
fn nobody_needs_to_listen_to_reports() {
    let mut session = session(0);
    let report = frame(&Reply::Read(read_reply(1, 1)));
    for _ in 0..5000 {
        session.process(ms(0), &report);
    }
    session.process(ms(0), b"the newest\n");
    assert_eq!(session.unsolicited_dropped(), 5001 - 4096);
    let messages: Vec<_> = std::iter::from_fn(|| session.take_unsolicited()).collect();
    assert_eq!(messages.len(), 4096);
    assert!(matches!(messages.last(), Some(Unsolicited::Line(_))));
}

#[test]
fn a_cancelled_request_leaves_the_session_free() {
    let mut session = session(0);
    session.request(Command::Erase).unwrap();
    sent(&mut session, ms(0)).unwrap();
    session.cancel(ms(10));
    assert_eq!(session.poll_at(), None);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(10)).unwrap();
    session.process(ms(20), &frame(&Reply::Erased));
    assert_eq!(session.take_answer(), None);
    session.process(ms(20), &frame(&RUNNING));
    assert_eq!(session.take_answer(), Some(Ok(RUNNING)));
}

fn read(start: u16) -> Command {
    Command::Read { start, count: 1 }
}

/// The starts of the reads that the session sends now.
fn starts(session: &mut Session, now: Duration) -> Vec<u16> {
    let mut starts = Vec::new();
    while let Some(attempt) = session.dispatch(now) {
        match attempt.command() {
            Command::Read { start, .. } => starts.push(*start),
            other => panic!("{other:?}"),
        }
    }
    starts
}

/// The answer to a read arrives.
fn answer(session: &mut Session, now: Duration, start: u16) {
    session.process(now, &frame(&Reply::Read(read_reply(start, 1))));
}

/// The start of the answer that is handed out, if there is one.
fn answered(session: &mut Session) -> Option<u16> {
    match session.take_answer()? {
        Ok(Reply::Read(reply)) => Some(reply.start),
        other => panic!("{other:?}"),
    }
}

/// A session with a recorder that has taken many requests while it answered others.
fn proven(retries: u32) -> Session {
    let mut session = session(retries);
    session.request(read(20)).unwrap();
    for start in 0..20 {
        session.request(read(start % 2 + 10)).unwrap();
        starts(&mut session, ms(0));
        answer(&mut session, ms(0), if start == 0 { 20 } else { (start + 1) % 2 + 10 });
        answered(&mut session).unwrap();
    }
    answer(&mut session, ms(0), 11);
    assert_eq!(answered(&mut session), Some(11));
    session
}

#[test]
fn two_reads_are_under_way_and_nothing_else_beside_them() {
    let mut session = session(0);
    assert!(session.has_room() && session.is_idle());
    session.request(read(1)).unwrap();
    assert_eq!(session.request(Command::QueryMode), Err(Busy));
    session.request(read(2)).unwrap();
    assert!(!session.has_room());
    assert_eq!(session.request(read(3)), Err(Busy));
    assert_eq!(starts(&mut session, ms(0)), [1, 2]);
    answer(&mut session, ms(100), 1);
    assert_eq!(session.request(read(3)), Err(Busy), "the answer has not been taken");
    assert_eq!(answered(&mut session), Some(1));
    session.request(read(3)).unwrap();
    assert_eq!(starts(&mut session, ms(100)), [3]);
    answer(&mut session, ms(200), 2);
    answer(&mut session, ms(300), 3);
    assert_eq!((answered(&mut session), answered(&mut session)), (Some(2), Some(3)));
    assert!(session.is_idle());
    session.request(Command::QueryMode).unwrap();
    assert!(!session.has_room());
    assert_eq!(session.request(read(1)), Err(Busy));
}

#[test]
fn the_time_for_an_answer_begins_when_the_one_before_is_there() {
    let mut session = session(0);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    assert_eq!(starts(&mut session, ms(0)), [1, 2]);
    assert_eq!(session.poll_at(), Some(ms(1000)));
    answer(&mut session, ms(900), 1);
    assert_eq!(answered(&mut session), Some(1));
    assert_eq!(session.poll_at(), Some(ms(1900)));
}

#[test]
fn an_answer_that_was_lost_is_noticed_by_the_next_one() {
    let mut session = proven(1);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    assert_eq!(starts(&mut session, ms(0)), [1, 2]);
    answer(&mut session, ms(100), 2);
    assert_eq!(answered(&mut session), Some(2));
    // The request is repeated at once, and alone.
    assert!(!session.has_room());
    assert_eq!(starts(&mut session, ms(100)), [1]);
    assert_eq!(session.poll_at(), Some(ms(1100)));
    answer(&mut session, ms(200), 1);
    assert_eq!(answered(&mut session), Some(1));
    assert!(session.has_room() && !session.is_one_at_a_time());
}

#[test]
fn an_answer_that_is_passed_over_again_and_again_is_given_up() {
    let mut session = proven(0);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    starts(&mut session, ms(0));
    answer(&mut session, ms(100), 2);
    assert_eq!(answered(&mut session), Some(2));
    let given_up = session.take_answer().unwrap().unwrap_err();
    assert_eq!((given_up.command, given_up.attempts), (Code::Read, 1));
    assert!(session.is_idle());
}

#[test]
fn after_a_timeout_both_are_asked_again_one_after_the_other() {
    let mut session = proven(1);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    starts(&mut session, ms(0));
    assert_eq!(starts(&mut session, ms(1000)), [1]);
    // The first answer was only late, and so was the second.
    answer(&mut session, ms(1100), 1);
    assert_eq!(answered(&mut session), Some(1));
    answer(&mut session, ms(1150), 2);
    assert_eq!(answered(&mut session), Some(2));
    // An answer to the repeated request may come and must not pass for another one.
    session.request(read(1)).unwrap();
    assert_eq!(starts(&mut session, ms(1150)), []);
    answer(&mut session, ms(1200), 1);
    assert_eq!(answered(&mut session), None);
    assert_eq!(starts(&mut session, ms(1200)), [1]);
    answer(&mut session, ms(1300), 1);
    assert_eq!(answered(&mut session), Some(1));
    assert!(!session.is_one_at_a_time());
}

#[test]
fn a_unit_that_takes_no_request_while_it_answers_is_asked_one_at_a_time() {
    for retries in [0, 2] {
        // The loss shows in the answer to the next request, or in a timeout.
        for next in [true, false] {
            let mut session = session(retries);
            session.request(read(1)).unwrap();
            session.request(read(2)).unwrap();
            assert_eq!(starts(&mut session, ms(0)), [1, 2]);
            answer(&mut session, ms(100), 1);
            assert_eq!(answered(&mut session), Some(1));
            let mut now = 100;
            if next {
                session.request(read(3)).unwrap();
                assert_eq!(starts(&mut session, ms(now)), [3]);
                now += 100;
                answer(&mut session, ms(now), 3);
                assert_eq!(answered(&mut session), Some(3));
            } else {
                now += 1000;
            }
            assert_eq!(starts(&mut session, ms(now)), [2]);
            assert!(session.is_one_at_a_time());
            now += 100;
            answer(&mut session, ms(now), 2);
            assert_eq!(answered(&mut session), Some(2));
            session.request(read(4)).unwrap();
            assert_eq!(session.request(read(5)), Err(Busy));
        }
    }
}

#[test]
fn a_unit_that_is_confused_by_a_second_request_is_asked_one_at_a_time() {
    let mut session = session(0);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    starts(&mut session, ms(0));
    // Neither is answered; that did not count as an attempt.
    assert_eq!(starts(&mut session, ms(1000)), [1]);
    assert!(session.is_one_at_a_time());
    answer(&mut session, ms(1100), 1);
    assert_eq!(answered(&mut session), Some(1));
    assert_eq!(starts(&mut session, ms(1100)), [2]);
    // This one counts.
    assert_eq!(starts(&mut session, ms(2100)), []);
    session.take_answer().unwrap().unwrap_err();
}

#[test]
fn one_loss_in_five_is_too_many_for_two_at_once() {
    let mut session = proven(2);
    let mut now = 0;
    for losses in 1.. {
        session.request(read(1)).unwrap();
        session.request(read(2)).unwrap();
        starts(&mut session, ms(now));
        answer(&mut session, ms(now), 2);
        assert_eq!(answered(&mut session), Some(2));
        assert_eq!(starts(&mut session, ms(now)), [1]);
        answer(&mut session, ms(now), 1);
        assert_eq!(answered(&mut session), Some(1));
        if session.is_one_at_a_time() {
            assert_eq!(losses, 3);
            break;
        }
        now += 2000;
    }
    // The line was at fault: the recorder has shown that it takes two.
    now += 2000;
    for answers in 1.. {
        session.request(read(1)).unwrap();
        assert!(!session.has_room());
        starts(&mut session, ms(now));
        answer(&mut session, ms(now), 1);
        assert_eq!(answered(&mut session), Some(1));
        if !session.is_one_at_a_time() {
            // The last repeat above was the first answer.
            assert_eq!(answers, 99);
            break;
        }
    }
}

#[test]
fn a_session_can_be_told_to_ask_one_at_a_time() {
    let mut session = session(0).one_at_a_time();
    session.request(read(1)).unwrap();
    assert!(!session.has_room() && session.is_one_at_a_time());
    assert_eq!(session.request(read(2)), Err(Busy));
}

#[test]
fn what_is_under_way_is_forgotten_together() {
    let mut session = proven(0);
    session.request(read(1)).unwrap();
    session.request(read(2)).unwrap();
    starts(&mut session, ms(0));
    session.cancel(ms(0));
    assert!(session.is_idle());
    // Late answers to them are no answers to new ones.
    session.request(read(2)).unwrap();
    session.request(read(3)).unwrap();
    assert_eq!(starts(&mut session, ms(0)), []);
    answer(&mut session, ms(100), 1);
    answer(&mut session, ms(100), 2);
    assert_eq!(answered(&mut session), None);
    assert_eq!(starts(&mut session, ms(100)), [2, 3]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever arrives in whatever pieces, the session stays usable, and the pieces do not change
    /// the outcome.
    #[test]
    fn any_bytes_in_any_pieces(
        noise in prop::collection::vec(prop_oneof![Just(0x1B), b'0'..=b'9', any::<u8>()], 0..300),
        cuts in prop::collection::vec(0_usize..400, 0..8),
    ) {
        let mut bytes = noise;
        bytes.extend(frame(&Reply::Read(ReadReply { entries: heapless::Vec::new(), model: None, ..read_reply(9, 1) })));
        let outcome = |cuts: &[usize]| {
            let mut session = session(0);
            session.request(Command::Read { start: 9, count: 0 }).unwrap();
            sent(&mut session, ms(0)).unwrap();
            let mut from = 0;
            for &cut in cuts.iter().chain([&usize::MAX]) {
                let to = cut.min(bytes.len());
                session.process(ms(1), &bytes[from.min(to)..to]);
                from = from.max(to);
            }
            (session.take_answer(), session.counters())
        };
        let whole = outcome(&[]);
        prop_assert!(matches!(whole.0, Some(Ok(Reply::Read(_)))));
        let mut cuts = cuts;
        cuts.sort_unstable();
        prop_assert_eq!(outcome(&cuts), whole);
    }
}

#[test]
fn it_is_known_when_a_request_was_sent_and_answered() {
    let mut session = session(1);
    assert_eq!(session.exchange(), None);
    session.request(Command::QueryMode).unwrap();
    sent(&mut session, ms(10)).unwrap();
    let bytes = frame(&RUNNING);
    session.process(ms(40), &bytes[..1]);
    session.process(ms(50), &bytes[1..]);
    assert_eq!(session.exchange(), None, "it has not been taken");
    session.take_answer().unwrap().unwrap();
    let exchange = session.exchange().unwrap();
    // The recorder had begun to answer when the first byte arrived.
    assert_eq!((exchange.attempts, exchange.carried_out()), (1, (ms(10), ms(40))));
}

#[test]
fn an_answer_may_be_to_any_attempt() {
    let mut session = session(1);
    session.request_set_clock().unwrap();
    sent(&mut session, ms(10)).unwrap();
    sent(&mut session, ms(1010)).unwrap();
    session.process(ms(1020), &frame(&Reply::ClockSet));
    session.take_answer().unwrap().unwrap();
    let exchange = session.exchange().unwrap();
    assert_eq!((exchange.attempts, exchange.last_sent), (2, ms(1010)));
    assert_eq!(exchange.carried_out(), (ms(10), ms(1020)));
}

#[test]
fn the_time_on_the_line_is_not_the_recorders() {
    let line_rate = LineRate::BitsPerSecond(9600);
    let mut session = Session::new(Timing { timeout: TIMEOUT, retries: 0, line_rate });
    session.request(Command::QueryMode).unwrap();
    let request = sent(&mut session, ms(0)).unwrap();
    let reply = frame(&RUNNING);
    session.process(ms(100), &reply);
    session.take_answer().unwrap().unwrap();
    // A line may be a little faster than it says.
    let at_least = |bytes: &[u8]| line_rate.time_for(bytes.len()) * 19 / 20;
    let (from, to) = session.exchange().unwrap().carried_out();
    let is_near = |time: Duration, expected: Duration| time.abs_diff(expected) < ms(1);
    assert!(is_near(from, at_least(&request)) && from <= line_rate.time_for(request.len()));
    assert!(is_near(to, ms(100) - at_least(&reply)), "{to:?}");
}
