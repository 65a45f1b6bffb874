//! `import` as a user asks for it, and what is told, letter by letter.
//!
//! `tests/import/CASE.stderr` is what stands on standard error; `SER_WRITE_EXPECTED=1` writes it
//! anew, for a person to review.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::ser_cli;
use serde_json::Value;
use tempfile::TempDir;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import")
}

fn run(arguments: &str) -> Output {
    let words = arguments.split_whitespace();
    ser_cli().current_dir(folder()).args(words).output().expect("ser-cli runs")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

/// Name, command line, exit code.
const CASES: [(&str, &str, i32); 14] = [
    ("relay", "import relay.txt --zone America/Chicago", 0),
    ("damaged", "import relay.txt --zone America/Chicago --fail-on-loss", 3),
    ("no-zone", "import relay.txt", 1),
    ("no-dates", "import open-dates.txt --zone UTC", 1),
    ("no-epoch", "import --format cytime events.json", 1),
    ("unknown", "import unknown.csv", 1),
    ("not-there", "import nowhere.txt", 1),
    ("folder", "import .", 1),
    ("data-alone", "import vendor.dat --zone UTC", 1),
    ("comtrade", "import vendor.cfg vendor.dat --zone UTC", 0),
    ("wrong-map", "import relay.txt --zone UTC --map wrong-map.toml --site plant.toml", 1),
    ("map-without-site", "import relay.txt --zone UTC --map map.toml", 1),
    ("map", "import relay.txt --zone UTC --map map.toml --site plant.toml", 0),
    ("empty", "import empty.txt --zone UTC", 1),
];

#[test]
fn what_is_told_is_told_letter_by_letter() {
    for (case, arguments, code) in CASES {
        let output = run(arguments);
        let expected = folder().join(format!("{case}.stderr"));
        if std::env::var_os("SER_WRITE_EXPECTED").is_some() {
            fs::write(&expected, &output.stderr).expect("a text");
        }
        let told = text(&output.stderr);
        assert_eq!(told, fs::read_to_string(&expected).unwrap_or_default(), "{case}");
        assert_eq!(output.status.code(), Some(code), "{case}: {told}");
        assert_eq!(output.stdout.is_empty(), code == 1, "{case}");
    }
}

/// A folder with the list of the relay, imported.
fn desk(arguments: &str) -> TempDir {
    let desk = tempfile::tempdir().expect("a folder");
    let output = desk.path().join("relay.jsonl");
    let arguments =
        format!("import relay.txt --zone America/Chicago {arguments} -o {}", output.display());
    let run = run(&arguments);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    assert!(run.stdout.is_empty());
    desk
}

fn report(desk: &TempDir, arguments: &str) -> String {
    let imported = desk.path().join("relay.jsonl");
    let arguments = format!(
        "report --site plant.toml --input {} --input ours.jsonl {arguments}",
        imported.display()
    );
    let run = run(&arguments);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    text(&run.stdout).to_owned()
}

#[test]
fn the_list_of_a_relay_and_ours_are_one_timeline() {
    let desk = desk("--doubt-ms 2");
    let json: Value = serde_json::from_str(&report(&desk, "--format json")).expect("JSON");
    let rows = json["sequence"].as_array().expect("rows");
    let told: Vec<String> = rows
        .iter()
        .map(|row| {
            let word = |key: &str| row[key].as_str().unwrap_or("-").to_owned();
            format!(
                "{} {} {} {}",
                word("recorder"),
                word("point"),
                word("state"),
                word("order_to_previous")
            )
        })
        .collect();
    assert_eq!(
        told,
        [
            "relay 51P1T Asserted -",
            // The relay's own rows are in the order of its list.
            "relay TRIP COIL 1 ENERGIZED before",
            // A millisecond later by another clock: nobody knows.
            "SER1 trip coil ON unknown",
            "relay 52A Deasserted before",
            "relay 52B Asserted before",
            // Ten milliseconds are more than what is doubtful about both clocks.
            "SER1 52-7 closed OFF before",
            "relay TRIP COIL 1 CALM before",
            "relay 51P1T Deasserted before",
            "SER1 trip coil OFF before",
            "relay Relay Settings Changed event before",
        ]
    );
    assert_eq!(
        rows[0]["shown"], "2027-03-14T19:29:58.080",
        "UTC, whatever the site says of clocks"
    );
    assert_eq!(rows[2]["shown"], "2027-03-14T14:29:58.105");
    let told = report(&desk, "");
    assert!(told.contains("first-out  51P1T Asserted (relay), 14:29:58.080"), "{told}");
    assert!(told.contains("52-7 opened"), "{told}");
    assert!(told.contains("order unknown within"), "{told}");
}

#[test]
fn a_clock_of_which_nothing_is_said_orders_nothing() {
    let desk = desk("");
    let told = report(&desk, "");
    assert!(told.contains("first-out  not certain"), "{told}");
    assert!(told.contains("never observed"), "{told}");
}

#[test]
fn what_is_imported_twice_is_there_once() {
    let desk = desk("--doubt-ms 2");
    let imported = desk.path().join("relay.jsonl");
    let once = report(&desk, "");
    assert_eq!(report(&desk, &format!("--input {}", imported.display())), once);
    // All records survive a merge.
    let merge =
        format!("merge --site plant.toml --input {} ours.jsonl --format jsonl", imported.display());
    let merged = run(&merge);
    assert_eq!(merged.status.code(), Some(0), "{}", text(&merged.stderr));
    fs::write(&imported, &merged.stdout).expect("a file");
    assert_eq!(report(&desk, ""), once);
}

#[test]
fn names_that_do_not_belong_together_are_told() {
    let desk = desk("");
    let other = desk.path().join("other.jsonl");
    let line = "{\"record\":\"point\",\"recorder\":\"relay\",\"input\":1,\"name\":\"A\",\"on\":\"ON\",\"off\":\"OFF\"}\n";
    fs::write(&other, line).expect("a file");
    let imported = desk.path().join("relay.jsonl");
    let run = run(&format!("merge --input {} {}", imported.display(), other.display()));
    let told = text(&run.stderr);
    assert!(told.contains("relay: one file calls input 1 \"51P1T\" and another \"A\""), "{told}");
    assert!(told.contains("import all files of one recorder at once"), "{told}");
}

#[test]
fn a_file_is_whole_or_not_there_and_none_is_overwritten_by_mistake() {
    let desk = desk("");
    let output = desk.path().join("relay.jsonl");
    let first = fs::read(&output).expect("a file");
    let again = format!("import relay.txt --zone UTC -o {}", output.display());
    let refused = run(&again);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("exists, and is not overwritten"));
    assert_eq!(fs::read(&output).expect("a file"), first);
    // Nothing is left of an import that fails, not even with --force.
    let failed = run(&format!("import relay.txt -o {} --force", output.display()));
    assert_eq!(failed.status.code(), Some(1));
    assert_eq!(fs::read(&output).expect("a file"), first);
    assert_eq!(run(&format!("{again} --force")).status.code(), Some(0));
    assert_ne!(fs::read(&output).expect("a file"), first);
    let names: Vec<_> = fs::read_dir(desk.path()).expect("a folder").collect();
    assert_eq!(names.len(), 1, "{names:?}");
    let to_stdout = run("import relay.txt --zone UTC -o -");
    assert_eq!(to_stdout.stdout, fs::read(&output).expect("a file"));
}

#[test]
fn our_own_files_pass_through() {
    let run = run("import ours.jsonl");
    let expected = fs::read_to_string(folder().join("ours.jsonl")).expect("a file");
    let lines = |text: &str| text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines(text(&run.stdout)), lines(&expected));
}

#[test]
fn what_we_export_for_others_can_be_imported() {
    let changes = |file: &Path| {
        let site = folder().join("plant.toml");
        let merge =
            format!("merge --site {} --input {} --format csv", site.display(), file.display());
        let merged = run(&merge);
        assert_eq!(merged.status.code(), Some(0), "{}", text(&merged.stderr));
        // Time in UTC and state of each change, without names.
        let rows = text(&merged.stdout).lines().skip(1).map(|row| {
            let fields: Vec<&str> = row.split(',').collect();
            format!("{} {}", fields[8], fields[3])
        });
        rows.collect::<Vec<_>>()
    };
    let ours = folder().join("ours.jsonl");
    let at = |times: Vec<String>| times.iter().map(|row| row[..23].to_owned()).collect::<Vec<_>>();
    for format in ["cff", "prc002"] {
        let desk = tempfile::tempdir().expect("a folder");
        let (exported, imported) = (desk.path().join("ours"), desk.path().join("again.jsonl"));
        let export = format!(
            "export --site plant.toml --input ours.jsonl --format {format} -o {}",
            exported.display()
        );
        let export = run(&export);
        assert_eq!(export.status.code(), Some(0), "{}", text(&export.stderr));
        let import = run(&format!("import {} -o {}", exported.display(), imported.display()));
        assert_eq!(import.status.code(), Some(0), "{format}: {}", text(&import.stderr));
        let (again, expected) = (changes(&imported), changes(&ours));
        assert_eq!(again.len(), 3, "{again:?}");
        assert_eq!(at(again), at(expected), "{format}");
    }
}

#[test]
fn samples_that_are_missing_are_told_and_make_the_report_incomplete() {
    let desk = tempfile::tempdir().expect("a folder");
    let at = |name: &str| desk.path().join(name);
    let cfg = "OAK,F3,2013\n4,0A,4D\n1,52A,,,1\n2,52B,,,0\n3,51P,,,0\n4,86,,,0\n60\n0\n0,5\n\
               14/03/2027,14:29:57.999000\n14/03/2027,14:29:58.000000\nASCII\n1\n0,0\n6,0\n";
    fs::write(at("f3.cfg"), cfg).expect("written");
    let rows = "1,0,1,0,0,0\r\n2,1000,1,0,1,0\r\n5,53000,0,1,1,1\r\n";
    fs::write(at("f3.dat"), rows).expect("written");
    let site = "site = \"OAK\"\ntime_zone = \"UTC\"\n[[recorder]]\nname = \"f3\"\n";
    fs::write(at("site.toml"), site).expect("written");
    let run = |arguments: &str| {
        let words = arguments.split_whitespace();
        ser_cli().current_dir(desk.path()).args(words).output().expect("ser-cli runs")
    };
    let import = run("import f3.cfg --doubt-ms 2 --fail-on-loss -o f3.jsonl");
    assert_eq!(import.status.code(), Some(3), "{}", text(&import.stderr));
    let told = "line 3: there are no samples 3 to 4, and meanwhile these changed: 52A, 52B, 86";
    assert!(text(&import.stderr).contains(told), "{}", text(&import.stderr));
    let report =
        run("report --site site.toml --input f3.jsonl --around 2027-03-14T14:29:58 --fail-on-loss");
    let shown = text(&report.stdout);
    assert!(shown.contains("inputs changed without being recorded: 2 3 4"), "{shown}");
    assert_eq!(report.status.code(), Some(3), "{}", text(&report.stderr));
}

#[test]
fn what_is_read_is_not_overwritten_even_with_force() {
    let desk = desk("");
    let at = |name: &str| desk.path().join(name).display().to_string();
    let before = fs::read(at("relay.jsonl")).expect("read");
    fs::copy(folder().join("plant.toml"), at("plant.toml")).expect("copied");
    for arguments in [
        format!("import {0} --force -o {0}", at("relay.jsonl")),
        format!(
            "export --site plant.toml --input {0} --format jsonl --force -o {0}",
            at("relay.jsonl")
        ),
        format!(
            "report --site plant.toml --input {0} --format json --force -o {0}",
            at("relay.jsonl")
        ),
        format!(
            "report --site {1} --input {0} --format json --force -o {1}",
            at("relay.jsonl"),
            at("plant.toml")
        ),
    ] {
        let run = run(&arguments);
        assert_eq!(run.status.code(), Some(1), "{arguments}: {}", text(&run.stderr));
        assert!(text(&run.stderr).contains("is read by this command"), "{}", text(&run.stderr));
    }
    assert_eq!(fs::read(at("relay.jsonl")).expect("read"), before);
}

#[test]
fn options_that_do_nothing_for_our_own_files_are_refused() {
    for option in ["--zone UTC", "--dates mdy", "--doubt-ms 2", "--recorder F3"] {
        let run = run(&format!("import ours.jsonl {option}"));
        assert_eq!(run.status.code(), Some(2), "{option}: {}", text(&run.stderr));
        let name = option.split(' ').next().expect("a name");
        assert!(text(&run.stderr).contains(&format!("{name} does nothing for")), "{option}");
    }
    let run = run("import relay.txt --zone UTC --doubt-ms 0.5");
    assert!(text(&run.stderr).contains("a whole number of milliseconds"), "{}", text(&run.stderr));
}

#[test]
fn a_list_is_not_the_log_of_a_recorder_that_is_read() {
    let desk = tempfile::tempdir().expect("a folder");
    let site = desk.path().join("site.toml");
    let about = "site = \"OAK\"\ntime_zone = \"UTC\"\n[[recorder]]\nname = \"F3\"\n\
                port = \"/dev/ttyUSB0\"\n[[recorder]]\nname = \"relay\"\n";
    fs::write(&site, about).expect("written");
    let site = site.display();
    let list = format!("import relay.txt --zone UTC --site {site}");
    let refused = run(&format!("{list} --recorder F3"));
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("F3 is a recorder of the site that is read at"));
    assert!(refused.stdout.is_empty());
    assert_eq!(run(&list).status.code(), Some(0), "this one has no port");
}

#[test]
fn a_list_that_was_imported_under_two_zones_is_told() {
    let desk = desk("");
    let other = desk.path().join("other.jsonl").display().to_string();
    let again = run(&format!("import relay.txt --zone Europe/Berlin -o {other}"));
    assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
    let first = desk.path().join("relay.jsonl").display().to_string();
    let merge = run(&format!("merge --site plant.toml --input {first} {other}"));
    let told = text(&merge.stderr);
    assert!(told.contains("relay: two lists of 7 events say the same, 6 h 00 min apart"), "{told}");
    let once = run(&format!("merge --site plant.toml --input {first} {first}"));
    assert!(!text(&once.stderr).contains("say the same"), "{}", text(&once.stderr));
}

/// More than fits into memory limits of lists: our own files are passed on as they are read.
#[test]
fn a_file_of_our_own_may_be_long() {
    let desk = tempfile::tempdir().expect("a folder");
    let at = |name: &str| desk.path().join(name).display().to_string();
    let mut rows = String::from("entry,time,input,state,sequence,life,note\n");
    let entries = 600_000;
    for entry in 0..entries {
        let (minute, second, ms) = (entry / 60_000, entry / 1000 % 60, entry % 1000);
        let (number, state, sequence) = (entry % 2048 + 1, entry % 2, entry + 1);
        rows += &format!(
            "{number},2026-11-22T10:{minute:02}:{second:02}.{ms:03},3,{state},{sequence},\
             9f3c5a7e21b04d68,\n"
        );
    }
    fs::write(at("U1.csv"), rows).expect("written");
    let import = run(&format!("import {} -o {}", at("U1.csv"), at("U1.jsonl")));
    assert_eq!(import.status.code(), Some(0), "{}", text(&import.stderr));
    assert!(text(&import.stderr).contains("U1: 600000 events"), "{}", text(&import.stderr));
    let written = fs::read_to_string(at("U1.jsonl")).expect("text");
    assert_eq!(written.lines().count(), entries + 1);
}

#[test]
fn an_import_of_our_own_file_keeps_a_trace_of_each_damaged_line() {
    let desk = tempfile::tempdir().expect("a folder");
    let at = |name: &str| desk.path().join(name).display().to_string();
    let head = "entry,time,input,state,sequence,life,note\n";
    let row = |sequence: u64| {
        format!("{sequence},2026-11-22T10:00:00.{sequence:03},3,1,{sequence},9f3c5a7e21b04d68,\n")
    };
    // Before the first entry, between two, a damaged loss, and behind the last one.
    let loss = ",,,,5,9f3c5a7e21b04d68,lost 3 (exactl) after 5: overwritten\n";
    let csv = format!("{head}x\n{}x\n{}{loss}{}x\n", row(3), row(5), row(9));
    let entries: String = [(3, 3), (5, 5), (9, 9)]
        .map(|(entry, sequence)| {
            format!(
                "{{\"record\":\"entry\",\"recorder\":\"U1\",\"entry\":{entry},\
                 \"time\":\"2026-11-22T10:00:00.00{entry}\",\"changed\":[3],\"state\":[3],\
                 \"sequence\":{sequence},\"life\":\"9f3c5a7e21b04d68\"}}\n{{\"record\":\"st\n"
            )
        })
        .concat();
    let head = "{\"record\":\"file\",\"schema\":1,\"program\":\"x\"}\n";
    let jsonl = format!("{head}{{\"record\":\"poi\n{entries}");
    for (name, content) in [("U1.csv", csv), ("U1.jsonl", jsonl)] {
        fs::write(desk.path().join(name), content).expect("written");
        let import =
            run(&format!("import {} --fail-on-loss -o {} --force", at(name), at("again.jsonl")));
        assert_eq!(import.status.code(), Some(3), "{}", text(&import.stderr));
        let report = |name: &str| {
            let input = format!("report --site plant.toml --input {}", at(name));
            let json = run(&format!("{input} --format json"));
            let mut json: Value = serde_json::from_slice(&json.stdout).expect("JSON");
            let strict = run(&format!("{input} --fail-on-loss"));
            assert_eq!(strict.status.code(), Some(3), "{}", text(&strict.stderr));
            assert_eq!(json["is_incomplete"], true, "{name}");
            (json["recorders"].take(), json["damaged_lines"].as_u64().expect("a number"))
        };
        let (original, imported) = (report(name), report("again.jsonl"));
        assert_eq!(imported.0, original.0, "{name}");
        assert_eq!((original.1, imported.1), (4, 1), "{name}: only one has no place");
        assert_eq!(
            original.0.to_string().matches("could not be read").count(),
            3,
            "{}",
            original.0
        );
    }
}

#[test]
fn damaged_lines_of_sources_are_told_by_an_export_that_cannot_say_so() {
    let desk = tempfile::tempdir().expect("a folder");
    let rows = "entry,time,input,state\n1,2026-11-22T10:00:00.250,3,1\nx\n";
    fs::write(desk.path().join("U1.csv"), rows).expect("written");
    let source = desk.path().join("U1.csv").display().to_string();
    for (format, is_told) in [("csv", true), ("jsonl", true), ("prc002", true), ("vcd", false)] {
        let export = run(&format!("export --site plant.toml --input {source} --format {format}"));
        let told = text(&export.stderr);
        assert_eq!(export.status.code(), Some(0), "{told}");
        assert_eq!(told.contains("1 damaged line of the sources"), is_told, "{format}: {told}");
        // Rows of the first versions have no sequence.
        assert_eq!(told.contains("nobody knows their place"), is_told, "{format}: {told}");
    }
}

#[test]
fn a_time_that_may_be_another_one_is_told_by_who_reads_it_later() {
    let desk = tempfile::tempdir().expect("a folder");
    let at = |name: &str| desk.path().join(name).display().to_string();
    let list = |time: &str| {
        format!(
            "#    DATE        TIME            ELEMENT   STATE\n\
             1    2026-10-25  {time}    52A       Asserted\n"
        )
    };
    for (time, is_told) in [("02:30:00.000", true), ("04:30:00.000", false)] {
        fs::write(desk.path().join("lone.txt"), list(time)).expect("written");
        let zone = "--zone Europe/Berlin --force -o";
        let import = run(&format!("import {} {zone} {}", at("lone.txt"), at("lone.jsonl")));
        assert_eq!(import.status.code(), Some(0), "{}", text(&import.stderr));
        for command in ["report", "merge", "export --format csv"] {
            let output = run(&format!("{command} --site plant.toml --input {}", at("lone.jsonl")));
            assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
            let told = text(&output.stderr);
            assert_eq!(
                told.contains("came twice or was left out: 1"),
                is_told,
                "{command}: {told}"
            );
        }
        // Also on the page and for programs, where nobody sees warnings.
        let report = format!("report --site plant.toml --input {} --format", at("lone.jsonl"));
        for (format, sign) in [
            ("text", "1 entry of the sources may be at another time"),
            ("html", "may be at another time by an hour"),
            ("json", "\"doubtful_hours\": 1"),
        ] {
            let output = run(&format!("{report} {format}"));
            let said: String =
                text(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(said.contains(sign), is_told, "{format}: {said}");
        }
    }
}
