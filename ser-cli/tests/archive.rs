//! Commands that read archives, as a user runs them.
#![cfg(all(unix, feature = "archive"))]

mod common;

use common::archived::{BEGIN_US, DAY_US, HOUR_US, Log, Plant, SITE, utc};
use ser_evidence::record::Life;
use serde_json::{Number, Value};

/// A report without what may be told of less when less is read.
fn told(mut report: Value) -> Value {
    for recorder in report["recorders"].as_array_mut().expect("recorders") {
        // The stretch without a gap is known as far as it was read.
        for end in ["unbroken_from", "unbroken_to"] {
            recorder.as_object_mut().expect("an object").remove(end).expect("a stretch");
        }
    }
    // Only an archive has them.
    report.as_object_mut().expect("an object").remove("archive_heads").expect("heads");
    report
}

/// A text with times to the second only: the best guess within what is known of a clock depends, by a
/// millisecond or two, on what else was read. What is known does not.
fn coarse(text: &str) -> String {
    let (mut coarse, mut rest) = (String::new(), text);
    while let Some((before, fraction)) = rest.split_once('.') {
        coarse.push_str(before);
        let is_time = before.len() > 6 && before[before.len() - 6..].starts_with(':');
        let digits = fraction.bytes().take_while(u8::is_ascii_digit).count();
        rest = if is_time { &fraction[digits..] } else { fraction };
    }
    coarse + rest
}

/// Microseconds are rounded here and there, and where a clock is hardly known, what lies far away
/// narrows that a little.
fn are_near(one: &Number, other: &Number) -> bool {
    let pair = one.as_i64().zip(other.as_i64());
    pair.is_some_and(|(one, other)| {
        one == other || one.abs() > 1000 && (one - other).abs() <= 2 + one.abs() / 100
    })
}

/// Where two values differ.
fn differences(at: &str, one: &Value, other: &Value) -> Vec<String> {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) if one.keys().eq(other.keys()) => {
            let of = |(key, value)| differences(&format!("{at}/{key}"), value, &other[key]);
            one.iter().flat_map(of).collect()
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            let pairs = one.iter().zip(other).enumerate();
            let of = |(index, (one, other))| differences(&format!("{at}/{index}"), one, other);
            pairs.flat_map(of).collect()
        }
        (Value::Number(one), Value::Number(other)) if are_near(one, other) => Vec::new(),
        _ if one == other => Vec::new(),
        (Value::String(one), Value::String(other)) if coarse(one) == coarse(other) => Vec::new(),
        _ => vec![format!("{at}: {one} and {other}")],
    }
}

#[test]
fn a_report_from_an_archive_says_what_one_from_all_its_records_says() {
    for seed in 0..3 {
        let plant = Plant::of_months(seed);
        let around = |day: i64, hour: i64| {
            format!("--around {}", utc(BEGIN_US + day * DAY_US + hour * HOUR_US))
        };
        let between = |from: i64, until: i64| {
            let time = |day| utc(BEGIN_US + day * DAY_US);
            format!("--since {} --until {}", time(from), time(until))
        };
        let mut choices = vec!["--last".to_owned(), String::new(), between(-9, 3)];
        choices.extend((0..120).step_by(7).map(|day| around(day, 11)));
        choices.extend([29, 30, 31, 32, 33, 60, 74, 75, 89, 90, 91].map(|day| around(day, 6)));
        choices.extend([between(28, 35), between(58, 62), between(89, 92), between(119, 400)]);
        for choice in choices {
            let of = |source: &str| {
                told(plant.json(&format!("report {source} --site plant.toml {choice}")))
            };
            let (part, all) = (of("--archive plant.db"), of("--input all.jsonl"));
            let differs = differences("", &part, &all);
            assert!(differs.is_empty(), "seed {seed}: {choice}: {differs:#?}");
        }
    }
}

/// When the trip is.
const TRIP_US: i64 = BEGIN_US + DAY_US + HOUR_US;

/// A trip on two recorders, with an entry lost in it, and a quiet change a day later.
fn plant_with_a_trip() -> Plant {
    let plant = Plant(tempfile::tempdir().expect("a folder"));
    let life = Life::from_bits(0x9f3c_5a7e_21b0_4d68);
    let other = Life::from_bits(0x9f3c_0000_0000_0001);
    let mut one = Log::default();
    one.moves(life, 7, BEGIN_US + HOUR_US, 0);
    one.moves(life, 1, TRIP_US, 0);
    let last = one.moves(life, 2, TRIP_US + 40_000, 0);
    one.asked(life, last, TRIP_US + 10_000_000, 0);
    let last = one.moves(life, 7, BEGIN_US + 2 * DAY_US + 2 * HOUR_US, 0);
    one.asked(life, last, BEGIN_US + 2 * DAY_US + 2 * HOUR_US + 10_000_000, 0);
    plant.add("U1", &one.records, true);
    let mut two = Log::default();
    two.moves(other, 1, TRIP_US + 20_000, 0);
    two.loses(other, 1);
    let last = two.moves(other, 3, TRIP_US + 60_000, 0);
    two.asked(other, last, TRIP_US + 10_000_000, 0);
    two.asked(other, last, BEGIN_US + 2 * DAY_US + 2 * HOUR_US + 20_000_000, 0);
    plant.add("U2", &two.records, true);
    plant
}

#[test]
fn events_are_found_by_time_recorder_point_and_group() {
    let plant = plant_with_a_trip();
    let list = |arguments: &str| plant.json(&format!("events --archive plant.db {arguments}"));
    let places = |found: &Value| -> Vec<String> {
        let events = found["events"].as_array().expect("events");
        let place = |event: &Value| match event["missing"].as_str() {
            Some(missing) => missing.to_owned(),
            None => format!("{}/{}", event["recorder"].as_str().unwrap(), event["sequence"]),
        };
        events.iter().map(place).collect()
    };
    let lost = "1 entry missing (overwritten)";
    let all = ["U1/1", "U1/2", "U2/1", "U1/3", lost, "U2/3", "U1/4"];
    assert_eq!(places(&list("")), all, "the newest is at the end");
    assert_eq!(places(&list("--limit 2")), all[4..]);
    assert_eq!(places(&list("--last")), ["U1/4"]);
    let day = "--since 2026-03-02 --until 2026-03-02T23:00";
    assert_eq!(places(&list(day)), all[1..6]);
    assert_eq!(places(&list(&format!("{day} --recorder U2"))), ["U2/1", lost, "U2/3"]);
    assert_eq!(places(&list("--around 2026-03-02")), all[1..6]);
    let named = "--site plant.toml";
    assert_eq!(places(&list(&format!("{named} --point 52a"))), ["U1/3"]);
    assert_eq!(places(&list(&format!("{named} --point U1/52a"))), ["U1/3"]);
    assert_eq!(places(&list(&format!("{named} --group protection"))), ["U1/2"]);
    assert_eq!(places(&list("--point 7 --recorder U1")), ["U1/1", "U1/4"]);
    // Any event of an incident names it.
    for name in ["U1/9f3c/2", "U2/9f3c/3", "U1/9f3c5a7e21b04d68/3"] {
        assert_eq!(places(&list(&format!("--incident {name}"))), all[1..6], "{name}");
    }
    let incident = list("--incident U1/9f3c/2 --site plant.toml");
    assert_eq!(incident["events"][0]["changes"][0]["point"], "86 lockout");
    assert_eq!(incident["events"][0]["time"], "2026-03-02T01:00:00.000000Z");
}

#[test]
fn every_format_of_events_has_the_losses_and_a_mistake_is_told_with_a_way_on() {
    let plant = plant_with_a_trip();
    let list = |arguments: &str| plant.ok(&format!("events --archive plant.db {arguments}"));
    let csv = list("--format csv");
    assert!(csv.starts_with("entry,time,input,state,sequence,life,note,recorder,utc,"), "{csv}");
    assert_eq!(csv.lines().filter(|line| line.contains("lost 1 (exactly)")).count(), 1, "{csv}");
    let table = list("");
    assert!(table.contains("1 entry missing (overwritten)"), "{table}");
    let jsonl = list("--format jsonl");
    assert_eq!(jsonl.lines().filter(|line| line.contains("\"record\":\"gap\"")).count(), 1);
    assert_eq!(jsonl.lines().filter(|line| line.contains("\"record\":\"entry\"")).count(), 6);
    // What was listed can be read again.
    std::fs::write(plant.path("part.jsonl"), jsonl).expect("a file");
    assert_eq!(plant.ok("merge --input part.jsonl --format csv").lines().count(), 8);
    plant.ends(3, "events --archive plant.db --fail-on-loss");
    plant.ends(0, "events --archive plant.db --fail-on-loss --recorder U1");
    for (arguments, hint) in [
        ("--recorder U9", "it has U1, U2"),
        ("--point 99T", "ser-cli site show"),
        ("--site plant.toml --group none", "it has protection"),
        ("--incident U9/9f3c/1", "ser-cli incident list"),
        ("--incident U1/9f3c/99", "ser-cli incident list"),
        ("--incident U1", "ser-cli incident list"),
        ("--since 2026-03-03 --until 2026-03-01", "exchange the two"),
    ] {
        let output = plant.run(&format!("events --archive plant.db {arguments}"));
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {told}");
        assert!(told.contains(hint), "{arguments}: {told}");
        assert!(output.stdout.is_empty(), "{arguments}");
    }
    let output = plant.run("events --archive nothing.db");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(told.contains("there is no archive") && told.contains("hint:"), "{told}");
    assert!(!plant.path("nothing.db").exists(), "a misspelled name is no new archive");
    let output = plant.run("events --archive postgres://ser:secret@db/plant");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(!told.contains("secret") && told.contains(".pgpass"), "{told}");
    assert_eq!(plant.run("events").status.code(), Some(2));
}

#[test]
fn incidents_are_listed_with_what_people_say_of_them() {
    let plant = plant_with_a_trip();
    let list = |arguments: &str| {
        let found = plant.json(&format!("incident list --archive plant.db {arguments}"));
        found["incidents"].as_array().expect("incidents").clone()
    };
    let all = list("--site plant.toml");
    let of = |key: &str| -> Vec<&Value> { all.iter().map(|incident| &incident[key]).collect() };
    assert_eq!(of("incident"), ["U1/9f3c/1", "U1/9f3c/2", "U1/9f3c/4"]);
    assert_eq!(of("events"), [1, 4, 1]);
    assert_eq!(all[1]["first_out"], serde_json::json!(["86 lockout ON"]));
    assert_eq!(all[1]["is_first_known"], true);
    assert_eq!(all[1]["recorders"], serde_json::json!(["U1", "U2"]));
    assert_eq!(of("is_complete"), [true, false, true]);
    assert_eq!(of("is_closed"), [false, false, false]);

    let say = |what: &str| plant.ok(&format!("incident {what} --archive plant.db"));
    let position = || plant.open().position().expect("a position");
    say("note U2/9f3c/1 who tested the relay?");
    let after_one = position();
    say("note U2/9f3c/1 who tested the relay?");
    assert_eq!(position(), after_one, "the same twice is one note");
    say("close U1/9f3c/2 ada did");
    let trip = &list("")[1];
    assert_eq!(trip["is_closed"], true);
    let notes: Vec<_> = trip["notes"].as_array().expect("notes").iter().collect();
    let texts: Vec<_> = notes.iter().map(|note| &note["text"]).collect();
    assert_eq!(texts, ["who tested the relay?", "ada did"]);
    assert!(!notes[0]["user"].as_str().expect("a user").is_empty());
    assert_eq!(list("--open").len(), 2);
    let table = plant.ok("incident list --archive plant.db");
    assert!(table.contains("closed: ada did"), "{table}");
    say("note U1/9f3c/3 but it was not reset");
    assert_eq!(list("")[1]["is_closed"], false, "a later note opens it again");
    say("close U1/9f3c/3");
    assert_eq!(list("")[1]["is_closed"], true);

    for (what, code) in [
        ("note U1/9f3c/99 nothing", 2),
        ("note U1/ffff/1 nothing", 2),
        ("note U1/9f3c/1", 2),
        ("note nonsense text", 2),
    ] {
        let before = position();
        plant.ends(code, &format!("incident {what} --archive plant.db"));
        assert_eq!(position(), before, "{what}");
    }
    let hostile = ["incident", "note", "U1/9f3c/1", "a\u{1b}[2J", "--archive", "plant.db"];
    let output = plant.run_words(&hostile);
    assert_eq!(output.status.code(), Some(2));
    assert!(!output.stderr.contains(&0x1b));
    // A report is as before, and says nothing else because of notes.
    let of = |source: &str| told(plant.json(&format!("report {source} --around 2026-03-02")));
    let differs = differences("", &of("--archive plant.db"), &of("--input all.jsonl"));
    assert!(differs.is_empty(), "{differs:#?}");
}

#[test]
fn an_incident_is_shown_with_the_names_of_its_time() {
    let plant = plant_with_a_trip();
    let renamed = SITE.replace("86 lockout", "86 bus lockout");
    plant.add_site(BEGIN_US - DAY_US, SITE);
    plant.add_site(TRIP_US + HOUR_US, &renamed);
    let first = |day: &str| {
        let report = plant.ok(&format!("report --archive plant.db --around {day}"));
        assert!(report.contains("Northfield"), "{report}");
        report
    };
    assert!(first("2026-03-02").contains("86 lockout"));
    assert!(!first("2026-03-02").contains("86 bus lockout"));
    let whole = plant.ok("merge --archive plant.db");
    assert!(whole.contains("86 bus lockout"), "everything has the newest names: {whole}");
    // The last trip is found by the role that is in the archive's site file.
    let trip = plant.json("report --archive plant.db");
    assert_eq!(trip["sequence"].as_array().map(Vec::len), Some(4));
    let given = plant.json("report --archive plant.db --site plant.toml");
    assert_eq!(given["sequence"], trip["sequence"]);
}

#[test]
fn an_archive_is_checked_verified_copied_and_shortened() {
    let plant = plant_with_a_trip();
    let check = plant.ends(3, "archive check --archive plant.db");
    assert!(check.contains("1 entry missing (overwritten) after 1 of life"), "{check}");
    let check: Value =
        serde_json::from_str(&plant.ends(3, "archive check --archive plant.db --format json"))
            .expect("JSON");
    assert_eq!((&check["is_sound"], &check["recorders"][0]["entries"]), (&true.into(), &4.into()));

    let verified = plant.json("archive verify --archive plant.db");
    let head = verified["heads"][0]["head"].as_str().expect("a head").to_owned();
    // A report says what to write down.
    let report = plant.ok("report --archive plant.db --around 2026-03-02");
    assert!(report.contains(&format!("archive head of U1 by cellar: sha256 {head}")), "{report}");
    let report = plant.json("report --archive plant.db --last");
    assert_eq!(report["archive_heads"].as_array().map(Vec::len), Some(2));
    plant.ok(&format!("archive verify --archive plant.db --head {head}"));
    plant.ok("incident close U1/9f3c/2 --archive plant.db");
    plant.ok(&format!("archive verify --archive plant.db --head {head}"));
    plant.ends(1, &format!("archive verify --archive plant.db --head {}", "7".repeat(64)));

    plant.ok("archive backup --archive plant.db -o copy.db");
    let copied = plant.json("archive verify --archive copy.db");
    assert_eq!(copied["heads"].as_array().map(Vec::len), Some(3));
    plant.ends(1, "archive backup --archive plant.db -o copy.db");

    plant.ends(2, "archive retain --archive plant.db --keep 1d");
    plant.ends(2, "archive retain --archive plant.db --yes");
    assert_eq!(plant.ok("events --archive plant.db --format csv").lines().count(), 8);
    plant.ok("archive retain --archive plant.db --keep 1d --yes");
    let check = plant.ends(3, "archive check --archive plant.db");
    assert!(check.contains("4 entries missing (too old for the archive)"), "{check}");
    plant.ok("archive verify --archive plant.db");

    // Somebody moves an entry by a second.
    let raw = rusqlite::Connection::open(plant.path("copy.db")).expect("a database");
    raw.execute(
        "UPDATE entry SET stamp = stamp + 65536, shown_us = shown_us + 1000000 \
                 WHERE sequence = 2",
        [],
    )
    .expect("it is changed");
    drop(raw);
    let output = plant.run("archive verify --archive copy.db");
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("was changed, removed or added"), "{told}");
}

#[test]
fn an_archive_stands_beside_files_and_in_the_environment() {
    let plant = plant_with_a_trip();
    let both = told(plant.json("report --archive plant.db --input all.jsonl --around 2026-03-02"));
    let one = told(plant.json("report --archive plant.db --around 2026-03-02"));
    assert_eq!(differences("", &both, &one), Vec::<String>::new());
    let mut command = common::ser_cli();
    command.current_dir(plant.0.path()).env("SER_ARCHIVE", "plant.db");
    let output = command.args(["report", "--last", "--format", "json"]).output().expect("it runs");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let export = |choice: &str| {
        plant.ok(&format!("export --archive plant.db --format csv {choice}")).lines().count()
    };
    assert_eq!((export(""), export("--around 2026-03-02"), export("--last")), (8, 6, 2));
    plant.ends(2, "report --archive plant.db --recorder U1");
    plant.ends(2, "report --live");
}
