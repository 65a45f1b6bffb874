//! What a site file says, from its text to the resolved site.

use std::ops::Range;

use jiff::tz::TimeZone;
use proptest::prelude::*;
use ser_console::is_obeyed;
use ser_evidence::site::{
    Chatter, ClockRule, Delays, Diagnostic, Edge, GroupId, IncidentRules, PointId, RecorderId,
    Role, Site, SiteDigest, inspect, read,
};
use ser_evidence::time::Moment;
use ser_proto::Model;

const NORTHFIELD: &str = include_str!("northfield.toml");

/// A file with these lines after the first two that each file has.
fn with(lines: &str) -> String {
    format!("site = \"A\"\ntime_zone = \"UTC\"\n{lines}\n")
}

fn good(lines: &str) -> Site {
    read(&with(lines)).expect("a good file")
}

/// What is told of a file, as `check: phrase`.
fn told(text: &str) -> Vec<String> {
    let line = |found: &Diagnostic| format!("{}: {}", found.check, found.phrase);
    inspect(text).diagnostics.iter().map(line).collect()
}

#[test]
fn a_whole_file_is_resolved() {
    let site = read(NORTHFIELD).unwrap();
    assert_eq!(site.name, "Northfield");
    assert_eq!(site.digest, Some(SiteDigest::of(NORTHFIELD)));
    assert_eq!(site.time_zone, TimeZone::get("Europe/Berlin").unwrap());
    assert_eq!(site.utc_doubt_us, Some(20_000));

    let [first, second] = site.recorders.as_slice() else { panic!("two recorders") };
    assert_eq!((first.model, second.model), (Some(Model::Ser320), Some(Model::Ser160)));
    assert_eq!((first.clock, second.clock), (ClockRule::Utc, ClockRule::Offset(19_800)));
    assert_eq!((first.drift_ppb, first.wander_ppb), (20_500, 5_000));
    let delays = Delays { closing_us: (10, 50), opening_us: (20, 320) };
    assert_eq!((first.delays, second.delays), (delays, Delays::default()));
    assert_eq!((first.is_original, second.is_original), (false, true));
    assert_eq!(second.log_size, Some(512));
    assert_eq!(second.port.as_deref(), Some("geni:/dev/shm/host?node=5"));

    let [breaker, phase, other] = site.points.as_slice() else { panic!("three points") };
    assert_eq!((breaker.recorder, breaker.input), (RecorderId(0), 7));
    assert_eq!((breaker.role, phase.role), (Some(Role::BreakerClosed), Some(Role::Pickup)));
    assert_eq!((breaker.on.as_str(), breaker.off.as_str()), ("CLOSED", "OPEN"));
    assert_eq!((phase.on.as_str(), phase.off.as_str()), ("ON", "OFF"));
    assert_eq!((breaker.normal, phase.normal), (Some(true), None));
    assert_eq!((breaker.group, breaker.equipment.as_deref()), (Some(GroupId(0)), Some("52-1")));
    assert_eq!(other.recorder, RecorderId(1));
    assert!(site.groups[0].first_out);

    let expected = &site.expectations[0];
    assert_eq!(expected.after, Edge { point: PointId(1), on: true });
    assert_eq!(expected.then, Edge { point: PointId(0), on: false });
    assert_eq!(expected.within_us, (15_000, 50_500));

    let seen = &site.observations[0];
    assert_eq!(seen.host_time, Moment::from_us(1_795_338_000_000_000));
    assert_eq!(seen.unit_time, Moment::from_us(1_795_338_000_120_000));
    assert_eq!(seen.doubt_us, 100_000);

    let shift = &site.shifts[0];
    assert_eq!((shift.us, shift.to.since(shift.from)), (-250_000, 4 * 3_600_000_000));

    let chatter = Chatter { changes: 5, within_us: 200_000 };
    assert_eq!(site.incident, IncidentRules { quiet_us: 2_500_000, chatter });
}

#[test]
fn a_pair_needs_to_be_named_on_one_side_only() {
    let site = read(NORTHFIELD).unwrap();
    assert_eq!(site.points[0].same_as, Some(PointId(2)));
    assert_eq!(site.points[2].same_as, Some(PointId(0)));

    let both = NORTHFIELD
        .replace("input = 3\n", "input = 3\nsame_as = \"U1-SER1/52-1 closed\"\ninverted = true\n");
    let site = read(&both).unwrap();
    assert_eq!(site.points[2].same_as, Some(PointId(0)));
    assert!(site.points[0].inverted && site.points[2].inverted && !site.points[1].inverted);
}

#[test]
fn pairs_that_contradict_each_other_are_told() {
    let pairs = |lines: [&str; 3]| {
        let recorders = "[[recorder]]\nname = \"A\"\n[[recorder]]\nname = \"B\"\n[[recorder]]\n\
                         name = \"C\"\n";
        let points = ["A", "B", "C"].into_iter().zip(lines).map(|(name, line)| {
            format!("[[point]]\nrecorder = \"{name}\"\ninput = 1\nname = \"{name}\"\n{line}\n")
        });
        told(&with(&format!("{recorders}{}", points.collect::<String>())))
    };
    assert_eq!(pairs(["same_as = \"B\"", "same_as = \"A\"", ""]), [""; 0]);
    assert_eq!(
        pairs(["same_as = \"B\"", "same_as = \"C\"", ""]),
        ["same-as: `B/B` is paired with another point"]
    );
    assert_eq!(
        pairs(["same_as = \"B\"", "", "same_as = \"B\""]),
        ["same-as: `B/B` is paired with another point"]
    );
    assert_eq!(
        pairs(["same_as = \"A\"", "inverted = true", ""]),
        [
            "same-as: a point is not the same contact as itself",
            "same-as: `inverted` says nothing without `same_as`"
        ]
    );
    assert_eq!(
        pairs(["same_as = \"B\"\ninverted = true", "inverted = false", ""]),
        ["same-as: the two points disagree about `inverted`"]
    );
}

#[test]
fn what_is_left_out_is_as_the_manual_says() {
    let site = good("[[recorder]]\nname = \"A\"\n[[point]]\ninput = 1\nname = \"x\"");
    let recorder = &site.recorders[0];
    assert_eq!(recorder, &ser_evidence::site::Recorder::named("A"));
    assert_eq!(recorder.clock, ClockRule::Local);
    assert_eq!(site.incident, IncidentRules::default());
    assert_eq!(site.utc_doubt_us, None);
}

#[test]
fn the_only_recorder_need_not_be_named() {
    let site = good("[[recorder]]\nname = \"A\"\n[[point]]\ninput = 1\nname = \"x\"");
    assert_eq!(site.points[0].recorder, RecorderId(0));
    let two = with(
        "[[recorder]]\nname = \"A\"\n[[recorder]]\nname = \"B\"\n[[point]]\ninput = 1\nname = \"x\"",
    );
    assert_eq!(told(&two), ["missing-key: a point lacks the key `recorder`"]);
    assert_eq!(inspect(&two).diagnostics[0].helps, ["add it, as in `recorder = \"A\"`"]);
}

#[test]
fn a_site_of_which_little_is_known_is_a_site() {
    assert_eq!(good("").recorders, []);
}

#[test]
fn a_name_with_a_slash_is_not_a_recorder_and_a_point() {
    let site = good(
        "[[recorder]]\nname = \"50\"\n[[point]]\ninput = 1\nname = \"50/51 A\"\n\
         [[point]]\ninput = 2\nname = \"t\"\n[[expect]]\nname = \"e\"\nafter = \"50/51 A on\"\n\
         then = \"50/t off\"\nwithin_ms = [0, 1]",
    );
    let expected = &site.expectations[0];
    assert_eq!((expected.after.point, expected.then.point), (PointId(0), PointId(1)));
}

#[test]
fn letters_from_right_to_left_are_letters() {
    for name in ["מפסק 52", "قاطع ۵۲", "می\u{200C}خواهم", "遮断器", "Ö-Schalter"]
    {
        let site = good(&format!("[[recorder]]\nname = \"{name}\""));
        assert_eq!(site.recorders[0].name, name);
    }
}

#[test]
fn hostile_names_are_refused_and_shown_harmlessly() {
    for name in [
        r"a\u001B[2J",
        r"a\nb",
        r"a\u202Eb",
        "a\u{202E}b",
        "a\u{2066}b",
        "a\u{200B}b",
        r"a\u0000",
        r"\uFEFFa",
        r"a\u0085b",
        "a\\U000E0041b",
    ] {
        let text = with(&format!("[[recorder]]\nname = \"{name}\""));
        assert_eq!(
            told(&text),
            ["hidden-character: `name` has a character that is not shown"],
            "{name:?}"
        );
    }
    let unknown = with(r#""\u001B[2J\u202E\n" = 1"#);
    assert_eq!(told(&unknown), [r"unknown-key: unknown key `\u{1b}[2J\u{202e}\n` in the site"]);
    let reference = with(
        "[[recorder]]\nname = \"A\"\n[[point]]\ninput = 1\nname = \"x\"\nrecorder = \"\\u001B\"",
    );
    assert_eq!(
        told(&reference),
        ["hidden-character: `recorder` has a character that is not shown"]
    );
}

#[test]
fn all_mistakes_are_told_at_once_in_the_order_of_the_file() {
    let text = "site = \"\"\ntimezone = \"UTC\"\n[[recorder]]\nname = \"A\"\nmodle = \"ser160\"\n\
                [[point]]\ninput = \"7\"\nrecorder = \"B\"\nrole = \"52c\"\n";
    assert_eq!(
        told(text),
        [
            "missing-key: the site lacks the key `time_zone`",
            "empty-text: `site` is empty",
            "unknown-key: unknown key `timezone` in the site",
            "unknown-key: unknown key `modle` in a recorder",
            "missing-key: a point lacks the key `name`",
            "wrong-type: `input` takes a whole number, not a text",
            "unknown-recorder: no recorder is called `B`",
            "unknown-word: `role` does not know `52c`",
        ]
    );
}

#[test]
fn several_lines_that_are_not_toml_are_told_at_once_with_the_mistakes_that_stay() {
    let text = with("[[recorder]]\nname = A\ndrift_pmm = 7\n[[point]]\ninput = \nname = \"x");
    let told = told(&text);
    assert_eq!(told.iter().filter(|line| line.starts_with("syntax:")).count(), 3, "{told:?}");
    assert_eq!(
        told.iter().filter(|line| !line.starts_with("syntax:")).collect::<Vec<_>>(),
        ["unknown-key: unknown key `drift_pmm` in a recorder"]
    );
}

#[test]
fn one_table_in_place_of_a_list_and_the_reverse_are_told_and_read_on() {
    let text = with("[recorder]\nname = \"A\"\n[[host]]\n[[point]]\ninput = 99\nname = \"x\"");
    assert_eq!(
        told(&text),
        [
            "wrong-type: `recorder` takes a list of tables, not one table",
            "wrong-type: `host` takes one table, not a list",
            "out-of-range: `input` is out of range",
        ]
    );
}

#[test]
fn a_warning_leaves_the_site_as_it_is() {
    let reading = inspect(&with("[[group]]\nname = \"G\""));
    assert!(reading.site.is_some());
    assert_eq!(reading.diagnostics.len(), 1);
    assert!(!reading.diagnostics[0].is_error());
}

#[test]
fn the_places_of_ports_are_known() {
    let reading = inspect(NORTHFIELD);
    let ports: Vec<_> = reading.ports.iter().map(|port| &NORTHFIELD[port.span.clone()]).collect();
    assert_eq!(ports, ["\"/dev/serial/by-id/usb-FTDI_A1\"", "\"geni:/dev/shm/host?node=5\""]);
    assert_eq!(reading.ports[1].recorder, RecorderId(1));
}

#[test]
fn a_byte_order_mark_and_windows_line_ends_are_no_mistakes() {
    let text = format!("\u{FEFF}{}", NORTHFIELD.replace('\n', "\r\n"));
    assert_eq!(told(&text), [""; 0]);
}

#[test]
fn a_file_of_mistakes_only_is_told_in_bounded_time_and_space() {
    let many = |line: &str| told(&line.repeat((4 << 20) / line.len())).len();
    for line in ["[[point]]\ninput=1\nname=\"x\"\n", "= 1\n", "[a]\n", "x.y=1\n", "[[expect]]\n"] {
        assert!(many(line) <= 201, "{line}");
    }
    // Of a very large text only the first place that is not TOML is told.
    assert_eq!(many("["), 1);
    assert_eq!(told(&"= 1\n".repeat(2000)).len(), 201);
    // Every name is compared with none of the others for ever.
    let points: String = (0..20_000)
        .map(|at| {
            format!(
                "[[point]]\ninput = 1\nname = \"point number {at}\"\nsame_as = \"poimt {at}\"\n"
            )
        })
        .collect();
    assert_eq!(told(&with(&format!("[[recorder]]\nname = \"A\"\n{points}"))).len(), 201);
}

/// Something that somebody might do to a file.
#[derive(Clone, Debug)]
enum Damage {
    Remove(Range<usize>),
    Insert(usize, String),
    Repeat(Range<usize>, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let place = 0..NORTHFIELD.len();
    let range = (place.clone(), 1..40_usize).prop_map(|(at, count)| at..at + count);
    let words = [
        "\"",
        "'",
        "[",
        "]",
        "[[",
        "{",
        "}",
        "=",
        ".",
        ",",
        "\n",
        "#",
        "\"\"\"",
        "-",
        "1e400",
        "nan",
        "true",
        "\u{202E}",
        "\u{1B}",
        "\u{0}",
        "é",
        "\\u001B",
        "\\",
        "[[point]]\n",
        "[point]\n",
        "input = 33\n",
        "same_as = \"U1-SER1/52-1 closed\"\n",
        "99999999999999999999",
        "0x1F",
        "name = \"\"\n",
        "2026-02-30T00:00:00Z",
    ];
    let text = prop_oneof![
        proptest::sample::select(words.to_vec()).prop_map(str::to_owned),
        any::<String>().prop_map(|text| text.chars().take(8).collect::<String>()),
    ];
    prop_oneof![
        range.clone().prop_map(Damage::Remove),
        (place.clone(), text).prop_map(|(at, text)| Damage::Insert(at, text)),
        (range, place).prop_map(|(range, at)| Damage::Repeat(range, at)),
    ]
}

fn damaged(damages: &[Damage]) -> String {
    let mut letters: Vec<char> = NORTHFIELD.chars().collect();
    for damage in damages {
        let within =
            |range: &Range<usize>, length: usize| range.start.min(length)..range.end.min(length);
        match damage {
            Damage::Remove(range) => drop(letters.drain(within(range, letters.len()))),
            Damage::Insert(at, text) => {
                let at = (*at).min(letters.len());
                letters.splice(at..at, text.chars());
            }
            Damage::Repeat(range, at) => {
                let piece = letters[within(range, letters.len())].to_vec();
                let at = (*at).min(letters.len());
                letters.splice(at..at, piece);
            }
        }
    }
    letters.into_iter().collect()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn whatever_the_text_it_is_a_site_or_told_with_places_and_harmlessly(
        damages in proptest::collection::vec(damage(), 1..6)
    ) {
        let text = damaged(&damages);
        let reading = inspect(&text);
        let has_errors = reading.diagnostics.iter().any(Diagnostic::is_error);
        prop_assert_eq!(reading.site.is_none(), has_errors, "{:?}", reading.diagnostics);
        for found in &reading.diagnostics {
            let related = found.related.iter().map(|related| &related.span);
            for span in related.chain([&found.span]) {
                prop_assert!(text.get(span.clone()).is_some(), "{:?}", found);
            }
            let labels = found.related.iter().map(|related| &related.label);
            for words in labels.chain(&found.helps).chain([&found.phrase, &found.label]) {
                prop_assert!(!words.chars().any(is_obeyed), "{:?}", words);
            }
        }
    }
}
