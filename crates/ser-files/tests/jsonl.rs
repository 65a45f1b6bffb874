//! JSON lines: what is written is read again, and what is wrong is named where it is.

use proptest::prelude::*;
use ser_evidence::record::{
    Boot, ClockObservation, ClockStep, CommandRecord, EntryRecord, Fellow, Gap, HostReading, How,
    Life, LifeRecord, Lost, NoteRecord, Outcome, Place, PointRecord, Record, RecorderRecord,
    Reference, SiteRecord, Suppressed, Told, Watched, Why,
};
use ser_evidence::time::{Bound, Moment, Scale};
use ser_files::jsonl::{MAX_LINE_LEN, Reader, SCHEMA, Writer};
use ser_files::{Problem, ReadError};
use ser_proto::{Entry, Inputs, Model, TimeStamp};

const TRIP: TimeStamp =
    TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 250 };

fn any_entry() -> impl Strategy<Value = Entry> {
    let fields = any::<(u8, u8, u8, u8, u8, u8, u16)>();
    (any::<u32>(), any::<u32>(), fields).prop_map(|(changed, state, fields)| {
        let (year, month, day, hour, minute, second, millisecond) = fields;
        let time = TimeStamp { year, month, day, hour, minute, second, millisecond };
        Entry { changed: Inputs(changed), state: Inputs(state), time }
    })
}

fn any_life() -> impl Strategy<Value = Life> {
    any::<u64>().prop_map(Life::from_bits)
}

/// Microseconds of a moment that a file may hold.
fn us() -> impl Strategy<Value = i64> {
    -(1_i64 << 60)..=1 << 60
}

fn any_reading() -> impl Strategy<Value = HostReading> {
    (any::<u128>(), us(), us(), any::<Option<u64>>()).prop_map(
        |(boot, monotonic, utc, utc_doubt_us)| {
            let (monotonic, utc) = (Moment::from_us(monotonic), Moment::from_us(utc));
            HostReading { boot: Boot(boot), monotonic, utc, utc_doubt_us }
        },
    )
}

fn any_bound<S: Scale>() -> impl Strategy<Value = Bound<S>> {
    (proptest::option::of(us()), proptest::option::of(us()))
        .prop_map(|(lo, hi)| Bound::new(lo.map(Moment::from_us), hi.map(Moment::from_us)))
}

fn any_place() -> impl Strategy<Value = Place> {
    let newest = proptest::option::of(any_entry());
    let fellow = proptest::option::of(
        (any::<i64>(), any_entry()).prop_map(|(ahead, entry)| Fellow { ahead, entry }),
    );
    (any_life(), any::<Option<u64>>(), any::<Option<u64>>(), newest, fellow).prop_map(
        |(life, after, before, newest, fellow)| Place { life, after, before, newest, fellow },
    )
}

fn any_how() -> impl Strategy<Value = How> {
    prop_oneof![
        any::<Option<u64>>().prop_map(|broadcast| How::Set { broadcast }),
        any::<u64>().prop_map(|broadcast| How::Mark { broadcast }),
        Just(How::Query),
        Just(How::Event),
        Just(How::Hand),
    ]
}

fn any_model() -> impl Strategy<Value = Option<Model>> {
    prop_oneof![Just(None), Just(Some(Model::Ser160)), Just(Some(Model::Ser320))]
}

fn any_clock() -> impl Strategy<Value = Record> {
    let at = prop_oneof![
        (any_bound(), any_reading())
            .prop_map(|(bound, reading)| Reference::Host { bound, reading }),
        any_bound().prop_map(Reference::Utc),
    ];
    let shown_ms = 0..ser_evidence::time::CENTURY_US / 1000;
    (any_how(), shown_ms, at, any_place()).prop_map(|(how, ms, at, place)| {
        Record::Clock(ClockObservation { how, shown: Moment::from_us(ms * 1000), at, place })
    })
}

fn any_gap() -> impl Strategy<Value = Record> {
    let lost = prop_oneof![
        any::<u32>().prop_map(Lost::Exactly),
        any::<u32>().prop_map(Lost::AtLeast),
        Just(Lost::Unknown),
    ];
    let why = prop_oneof![
        Just(Why::Overwritten),
        Just(Why::LogBeganAnew),
        any::<u32>().prop_map(Why::NotRecorded),
        Just(Why::NotReached),
        Just(Why::Unreadable),
    ];
    (any_life(), any::<Option<u64>>(), lost, why)
        .prop_map(|(life, after, lost, why)| Record::Gap(Gap { life, after, lost, why }))
}

fn any_command() -> impl Strategy<Value = Record> {
    let outcome = prop_oneof![
        Just(Outcome::Done),
        Just(Outcome::Sent),
        any_name().prop_map(Outcome::Refused),
        any_name().prop_map(Outcome::NotAnswered),
        any_name().prop_map(Outcome::NotSent),
    ];
    let names = (any_name(), any_name(), any_name(), any_name());
    (any_reading(), names, any_name(), outcome).prop_map(
        |(at, (user, host, program, peer), command, outcome)| {
            let record = CommandRecord { at, user, host, program, peer, command, outcome };
            Record::Command(record)
        },
    )
}

fn any_record() -> impl Strategy<Value = Record> {
    let entry = (any_life(), any::<(Option<u64>, u16, u32)>(), any_entry());
    let erased = proptest::option::of(any_life());
    let life = (any_life(), any::<(bool, Option<u16>)>(), any_model(), erased);
    prop_oneof![
        entry.prop_map(|(life, (sequence, number, known), entry)| {
            let known = Inputs(known);
            Record::Entry(EntryRecord { life, sequence, number, entry, known })
        }),
        any_gap(),
        any_clock(),
        (any_place(), any_reading())
            .prop_map(|(place, reading)| Record::Step(ClockStep { place, reading })),
        life.prop_map(|(life, (is_exact, size), model, erased)| {
            Record::Life(LifeRecord { life, is_exact, model, size, erased })
        }),
        (any_life(), any_reading(), any_reading(), any::<u64>()).prop_map(
            |(life, from, to, through)| Record::Watched(Watched { life, from, to, through })
        ),
        (
            any_reading(),
            any_reading(),
            any::<u64>(),
            proptest::collection::btree_map(1_u8..=32, any::<u32>(), 0..5),
        )
            .prop_map(|(from, to, on_for_us, left_out)| {
                Record::Suppressed(Suppressed { from, to, on_for_us, left_out })
            }),
        (1_u8..=32, any_name(), any_name(), any_name()).prop_map(|(input, name, on, off)| {
            Record::Point(PointRecord { input, name, on, off })
        }),
        (-86_399..=86_399)
            .prop_map(|utc_offset_s| { Record::Recorder(RecorderRecord { utc_offset_s }) }),
        any_command(),
        (any_reading(), (any_name(), any_name()), any_life(), any::<u64>(), any_remark()).prop_map(
            |(at, (user, host), life, sequence, (text, closes))| {
                Record::Note(NoteRecord { at, user, host, life, sequence, text, closes })
            }
        ),
        (any_reading(), "([^\\p{Cc}]|[\t\r\n]){0,200}")
            .prop_map(|(at, text)| Record::Site(SiteRecord { at, text })),
    ]
}

/// The text of a note, and whether it closes.
fn any_remark() -> impl Strategy<Value = (String, bool)> {
    prop_oneof![(any_name(), any::<bool>()), Just((String::new(), true))]
}

/// What a person can see, in any script.
fn any_name() -> impl Strategy<Value = String> {
    "[^\\p{C}\\p{Z}]([^\\p{C}\\p{Z}]| ){0,99}[^\\p{C}\\p{Z}]"
}

fn read(text: &str) -> Vec<Result<Told, ReadError>> {
    Reader::new(text.as_bytes(), "the stem").collect()
}

proptest! {
    #[test]
    fn every_record_is_read_as_it_is_written(
        all in proptest::collection::vec((any::<String>(), any_record()), 1..8),
    ) {
        let mut text = Vec::new();
        let mut writer = Writer::new(&mut text);
        writer.file("ser-cli 0.1.0").unwrap();
        for (recorder, record) in &all {
            writer.record(recorder, record).unwrap();
        }
        let text = String::from_utf8(text).unwrap();
        prop_assert_eq!(text.lines().count(), 1 + all.len(), "a line each");
        let told: Vec<_> = read(&text).into_iter().map(Result::unwrap).collect();
        let all: Vec<_> =
            all.into_iter().map(|(recorder, record)| Told { recorder, record }).collect();
        prop_assert_eq!(told, all);
    }

    #[test]
    fn nothing_that_is_in_a_file_is_too_much(
        text in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        Reader::new(&text[..], "").for_each(drop);
    }
}

fn entry_record() -> EntryRecord {
    let entry = Entry { changed: Inputs(0b100), state: Inputs(0b1_0000_0100), time: TRIP };
    EntryRecord {
        life: Life::from_name("9f3c5a7e21b04d68").unwrap(),
        sequence: Some(120),
        number: 17,
        entry,
        known: EntryRecord::ALL_KNOWN,
    }
}

fn problem(line: &str) -> String {
    let read = read(line);
    let [Err(error)] = &read[..] else { panic!("{read:?}") };
    error.to_string()
}

#[test]
fn the_lines_of_the_manual_are_written() {
    let mut text = Vec::new();
    let mut writer = Writer::new(&mut text);
    writer.file("ser-cli 0.1.0").unwrap();
    writer.entry("U1", &entry_record(), Some("the clock went back")).unwrap();
    let life = entry_record().life;
    let gap = Gap { life, after: Some(120), lost: Lost::Exactly(37), why: Why::Overwritten };
    writer.record("U1", &Record::Gap(gap)).unwrap();
    let text = String::from_utf8(text).unwrap();
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(
        lines,
        [
            r#"{"record":"file","schema":1,"program":"ser-cli 0.1.0"}"#,
            r#"{"record":"entry","recorder":"U1","entry":17,"time":"2026-11-22T10:00:00.250","changed":[3],"state":[3,9],"sequence":120,"life":"9f3c5a7e21b04d68","note":"the clock went back"}"#,
            r#"{"record":"gap","recorder":"U1","lost":37,"count":"exactly","after":120,"why":"overwritten","life":"9f3c5a7e21b04d68"}"#,
        ]
    );
}

#[test]
fn lines_of_before_records_had_names_are_read() {
    let text = concat!(
        r#"{"entry":17,"time":"2026-11-22T10:00:00.250","changed":[3],"state":[3,9],"#,
        r#""sequence":120,"life":"9f3c5a7e21b04d68"}"#,
        "\n",
        r#"{"lost":null,"count":"unknown","after":120,"why":"not recorded","inputs":[1,3],"#,
        r#""life":"9f3c5a7e21b04d68"}"#,
        "\n",
    );
    let told: Vec<_> = read(text).into_iter().map(Result::unwrap).collect();
    let life = entry_record().life;
    let why = Why::NotRecorded(0b101);
    let records = [
        Record::Entry(entry_record()),
        Record::Gap(Gap { life, after: Some(120), lost: Lost::Unknown, why }),
    ];
    let recorder = || "the stem".to_owned();
    assert_eq!(told, records.map(|record| Told { recorder: recorder(), record }));
}

#[test]
fn what_a_later_program_adds_is_passed_over_and_what_it_changes_is_refused() {
    let file =
        |schema: u32| format!("{{\"record\":\"file\",\"schema\":{schema},\"more\":[{{}}]}}\n");
    let entry = "{\"record\":\"entry\",\"recorder\":\"U1\",\"entry\":1,\
                 \"time\":\"2026-11-22T10:00:00.250\",\"changed\":[3],\"state\":[3],\
                 \"sequence\":1,\"life\":\"0\",\"colour\":\"red\"}\n";
    assert!(read(&(file(SCHEMA) + entry)).iter().all(Result::is_ok));
    let read = read(&(entry.to_owned() + &file(SCHEMA + 1) + entry));
    let [Ok(_), Err(error)] = &read[..] else { panic!("{read:?}") };
    assert!(matches!(error.problem, Problem::NewerSchema { schema } if schema == SCHEMA + 1));
    assert!(!error.is_of_one_line());
    assert_eq!(
        error.to_string(),
        "line 2: written by a later version (schema 2; this one reads up to 1)"
    );
}

#[test]
fn an_unknown_kind_of_record_is_an_error_because_it_may_be_evidence() {
    assert_eq!(problem(r#"{"record":"trip"}"#), "line 1: there is no record `trip`");
    assert_eq!(
        problem(r#"{"recorder":"U1"}"#),
        "line 1: neither `record` nor `entry` nor `lost` says what this is"
    );
}

#[test]
fn a_damaged_line_is_named_and_those_around_it_are_read() {
    let mut text = Vec::new();
    Writer::new(&mut text).record("U1", &Record::Entry(entry_record())).unwrap();
    let good = String::from_utf8(text).unwrap();
    let torn = &good[..60];
    let read = read(&format!("{good}{torn}\n{good}"));
    let [Ok(_), Err(error), Ok(_)] = &read[..] else { panic!("{read:?}") };
    assert_eq!((error.line, error.byte), (2, Some(60)));
    assert!(error.is_of_one_line());
    assert!(error.to_string().starts_with("line 2, byte 60: EOF while parsing"), "{error}");
}

#[test]
fn every_field_is_checked() {
    let entry = |time: &str, changed: &str, life: &str| {
        format!(
            "{{\"entry\":1,\"time\":\"{time}\",\"changed\":{changed},\"state\":[],\
             \"life\":\"{life}\"}}"
        )
    };
    let noon = "2026-11-22T12:00:00.000";
    let note = |more: &str| {
        let host = "00000000000000000000000000000001";
        format!(
            "{{\"record\":\"note\",\"life\":\"0\",\"sequence\":1,\"host\":{{\"boot\":\"{host}\",\
             \"monotonic_us\":1,\"utc_us\":1}},{more}}}"
        )
    };
    for (line, what) in [
        (entry("noon", "[]", "0"), "`time` cannot be `noon`"),
        (entry(noon, "[33]", "0"), "there is no input 33"),
        (entry(noon, "[0]", "0"), "there is no input 0"),
        (entry(noon, "[]", "x"), "`life` cannot be `x`"),
        (r#"{"entry":70000}"#.to_owned(), "invalid value: integer `70000`"),
        (r#"{"entry":1}"#.to_owned(), "`time` is missing"),
        (r#"{"entry":1,"entry":1}"#.to_owned(), "duplicate field `entry`"),
        (r#"{"record":"file"}"#.to_owned(), "`schema` is missing"),
        (r#"{"record":"gap","count":"some"}"#.to_owned(), "`count` cannot be `some`"),
        (r#"{"record":"gap","count":"exactly"}"#.to_owned(), "`lost` is missing"),
        (
            r#"{"record":"gap","count":"unknown","why":"not recorded"}"#.to_owned(),
            "`inputs` is missing",
        ),
        (
            r#"{"record":"clock","how":"query","shown":"2026-02-29T00:00:00.000"}"#.to_owned(),
            "`shown` cannot be",
        ),
        (r#"["entry","U1"]"#.to_owned(), "this is not an object"),
        (note(r#""text":"two\nlines","closes":true"#), "`text` cannot be `two\nlines`"),
        (note(r#""text":"","closes":false"#), "`text` cannot be ``"),
        (note(&format!(r#""text":"{}","closes":true"#, "x".repeat(4001))), "`text` cannot be"),
        (note(r#""text":"fine""#), "`closes` is missing"),
        (note(r#""text":"fine","closes":true,"user":"a\u001b""#), "`user` cannot be"),
        (note(r#""text":"fine","closes":true,"user":"ada""#), "`host_name` is missing"),
        (r#"{"record":"site","text":"\u0007"}"#.to_owned(), "`text` cannot be"),
        (r#"{"record":"site","text":"","host":null}"#.to_owned(), "`host` is missing"),
    ] {
        assert!(problem(&line).contains(what), "{line}: {}", problem(&line));
    }
}

#[test]
fn what_is_quoted_of_a_file_is_short() {
    let long = "x".repeat(MAX_LINE_LEN - 50);
    assert_eq!(MAX_LINE_LEN, 4 << 20);
    assert!(problem(&format!("{{\"record\":\"{long}\"}}")).len() < 100);
    assert!(problem(&format!("{{\"record\":\"{long}")).len() < 200);
    assert!(problem(&"x".repeat(2 * MAX_LINE_LEN)).ends_with("longer than 4194304 bytes"));
}

#[test]
fn the_longest_site_file_is_read_as_it_was_written_whatever_is_in_it() {
    let at = HostReading {
        boot: Boot(1),
        monotonic: Moment::from_us(1),
        utc: Moment::from_us(1),
        utc_doubt_us: None,
    };
    for letter in ["\"", "\n", "\u{061C}", "\u{2028}", "é", "x"] {
        let text = letter.repeat(SiteRecord::LONGEST / letter.len());
        let record = Record::Site(SiteRecord { at, text });
        let mut written = Vec::new();
        Writer::new(&mut written).record("U1", &record).unwrap();
        assert_eq!(Reader::new(&written[..], "").read().unwrap().unwrap(), record, "{letter:?}");
    }
    let line = format!("{{\"record\":\"site\",\"text\":\"{}\"}}", "x".repeat((1 << 20) + 1));
    assert!(problem(&line).starts_with("line 1: `text` cannot be `xxx"));
}

#[test]
fn a_clock_that_shows_no_stamp_cannot_be_written() {
    let clock = ClockObservation {
        how: How::Query,
        shown: Moment::from_us(1),
        at: Reference::Utc(Bound::UNKNOWN),
        place: Place::UNKNOWN,
    };
    let mut text = Vec::new();
    assert!(Writer::new(&mut text).record("U1", &Record::Clock(clock)).is_err());
    assert!(text.is_empty(), "no half of a line");
}

#[test]
fn a_name_that_a_terminal_would_obey_is_escaped_and_read_back_as_it_was() {
    let names = ["A\u{1b}[2J\u{7f}", "B\u{202e}\u{2066}\u{9b}é", "C\r\n\"\\", "plain"];
    let life = LifeRecord {
        life: Life::from_bits(7),
        is_exact: true,
        model: None,
        size: None,
        erased: None,
    };
    let mut lines = Vec::new();
    let mut writer = Writer::new(&mut lines);
    for name in names {
        writer.record(name, &Record::Life(life)).unwrap();
    }
    let text = std::str::from_utf8(&lines).unwrap();
    assert!(!text.contains(|letter| letter != '\n' && ser_console::is_obeyed(letter)), "{text:?}");
    assert!(text.contains("\"B\\u202e\\u2066\\u009bé\""), "{text}");
    let read = Reader::new(lines.as_slice(), "").map(|told| told.unwrap().recorder.to_string());
    assert_eq!(read.collect::<Vec<_>>(), names);
}

#[test]
fn a_moment_that_cannot_be_reckoned_with_is_refused() {
    let host = "\"host\":{\"boot\":\"00000000000000000000000000000001\",\"monotonic_us\":1,\
                \"utc_us\":1}";
    let line = |lo: &str| {
        format!(
            "{{\"record\":\"clock\",\"recorder\":\"U1\",\"how\":\"query\",\
             \"shown\":\"2026-11-22T10:00:00.000\",\"scale\":\"host\",\"lo_us\":{lo},{host}}}\n"
        )
    };
    let read = |text: String| Reader::new(text.as_bytes(), "U1").next().expect("a line").is_ok();
    assert!(read(line("0")));
    for beyond in ["9223372036854775807", "-9223372036854775808"] {
        assert!(!read(line(beyond)), "{beyond}");
    }
}

#[test]
fn a_name_that_cannot_be_shown_is_refused() {
    let line = |input: u8, name: &str, off: &str| {
        format!(
            "{{\"record\":\"point\",\"recorder\":\"F3\",\"input\":{input},\"name\":\"{name}\",\
             \"on\":\"ON\",\"off\":\"{off}\"}}\n"
        )
    };
    assert!(read(&line(32, "87T", "OFF"))[0].is_ok());
    let long = "x".repeat(201);
    for (input, name, off) in [
        (0, "87T", "OFF"),
        (33, "87T", "OFF"),
        (1, "", "OFF"),
        (1, " 87T", "OFF"),
        (1, "87T", "\\u001b[2J"),
        (1, "\\u202e", "OFF"),
        (1, &long, "OFF"),
    ] {
        assert!(read(&line(input, name, off))[0].is_err(), "{input} {name} {off}");
    }
    let offset = |seconds: &str| {
        format!("{{\"record\":\"recorder\",\"recorder\":\"F3\",\"utc_offset_s\":{seconds}}}")
    };
    assert!(read(&offset("-86399"))[0].is_ok());
    assert_eq!(problem(&offset("86400")), "line 1: `utc_offset_s` cannot be `86400`");
}

const COMMAND: &str = concat!(
    r#"{"record":"command","recorder":"U1","command":"set clock to 2026-11-22T10:00:00.000","#,
    r#""outcome":"not answered","why":"no answer","user":"anna","host_name":"desk-7","#,
    r#""program":"ser-cli 0.1.0","peer":"/dev/ttyUSB0","host":{"#,
    r#""boot":"51142df50ced42cb8820275946f0d78c","monotonic_us":14219142182,"#,
    r#""utc_us":1796031150892079,"utc_doubt_us":null}}"#,
);

#[test]
fn a_command_is_a_line_that_a_person_can_read() {
    let read = read(COMMAND);
    let [Ok(Told { recorder, record: Record::Command(command) })] = &read[..] else {
        panic!("{read:?}")
    };
    assert_eq!((&**recorder, &*command.user, &*command.host), ("U1", "anna", "desk-7"));
    assert_eq!(command.outcome, Outcome::NotAnswered("no answer".to_owned()));
    let mut text = Vec::new();
    Writer::new(&mut text).record(recorder, &Record::Command(command.clone())).unwrap();
    assert_eq!(std::str::from_utf8(&text).unwrap(), format!("{COMMAND}\n"));
}

#[test]
fn every_text_of_a_command_is_bounded_and_can_be_seen() {
    for field in ["user", "host_name", "program", "peer", "command", "why", "outcome"] {
        let before = format!("\"{field}\":\"");
        let (head, tail) = COMMAND.split_once(&before).unwrap();
        let (_, tail) = tail.split_once('"').unwrap();
        let with = |text: &str| format!("{head}{before}{text}\"{tail}");
        let longest = match field {
            "command" | "why" => CommandRecord::LONGEST_TEXT,
            _ => CommandRecord::LONGEST_NAME,
        };
        let wrong = |text: &str| problem(&with(text));
        for text in ["", " x", "x ", "x\\u001b[2J", "a\\nb", &"x".repeat(longest + 1)] {
            assert!(wrong(text).contains(&format!("`{field}` cannot be")), "{}", wrong(text));
        }
        if field == "outcome" {
            assert!(wrong("carried out").contains("`outcome` cannot be `carried out`"));
        } else {
            assert!(read(&with(&"x".repeat(longest))).iter().all(Result::is_ok), "{field}");
        }
        let missing = problem(&format!("{head}\"x\":\"\"{tail}"));
        assert!(missing.contains(&format!("`{field}` is missing")), "{missing}");
    }
}
