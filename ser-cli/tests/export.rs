//! `export` as a user asks for it: what is written where, and what is left when that fails.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::bench::text;
use common::{Running, ser_cli, wait_until};
use tempfile::TempDir;

const HEADER: &str = "entry,time,input,state,sequence,life,note";

const SITE: &str = "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"
[[recorder]]\nname = \"U1\"\nclock = \"utc\"
[[point]]\nrecorder = \"U1\"\ninput = 3\nname = \"52-1 closed\"\nrole = \"trip\"
on = \"CLOSED\"\noff = \"OPEN\"
";

/// A folder with a site file and what a recorder has written.
struct Desk(TempDir);

impl Desk {
    fn new() -> Desk {
        let desk = Desk(tempfile::tempdir().expect("a folder"));
        let rows = [
            "1,2026-11-22T09:00:00.250,3,1,1,9f3c5a7e21b04d68,",
            "2,2026-11-22T09:00:00.307,3,0,2,9f3c5a7e21b04d68,",
            ",,,,2,9f3c5a7e21b04d68,lost 37 (exactly) after 2: overwritten",
            "40,2026-11-22T10:30:00.000,4,1,40,9f3c5a7e21b04d68,",
        ];
        fs::write(desk.path("U1.csv"), format!("{HEADER}\n{}\n", rows.join("\n"))).expect("a file");
        fs::write(desk.path("north.toml"), SITE).expect("a file");
        desk
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = ser_cli();
        command.current_dir(self.0.path()).args(["export", "--site", "north.toml"]);
        command.args(["--input", "U1.csv"]).args(arguments.split_whitespace());
        command
    }

    fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().expect("ser-cli runs")
    }

    /// Standard output of a command that must succeed.
    fn ok(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// What is told by a command that must fail with this exit code.
    fn refused(&self, arguments: &str, code: i32) -> String {
        let output = self.run(arguments);
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {told}");
        assert!(told.contains("hint: "), "{told}");
        assert!(output.stdout.is_empty(), "{arguments}");
        told
    }

    /// What was made.
    fn made(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).expect("a folder");
        let names = names.map(|file| file.expect("a file").file_name());
        let mut names: Vec<String> = names
            .map(|name| name.to_string_lossy().into_owned())
            .filter(|name| !["U1.csv", "north.toml"].contains(&name.as_str()))
            .collect();
        names.sort();
        names
    }
}

#[test]
fn a_table_has_the_names_of_the_site_and_every_loss() {
    let csv = Desk::new().ok("--format csv");
    let rows: Vec<&str> = csv.split_terminator("\r\n").collect();
    assert_eq!(rows[0], format!("{HEADER},recorder,utc,utc_earliest,utc_latest,point,meaning"));
    assert!(rows[1].ends_with(",U1,2026-11-22T09:00:00.250000Z,,,52-1 closed,CLOSED"), "{csv}");
    let loss = ",,,,2,9f3c5a7e21b04d68,lost 37 (exactly) after 2: overwritten,U1,,,,,";
    assert_eq!(rows[3], loss);
    assert_eq!(rows.len(), 5);
}

#[test]
fn json_lines_are_exported_byte_for_byte_once_they_were_read() {
    let desk = Desk::new();
    let first = desk.ok("--format jsonl");
    fs::write(desk.path("all.jsonl"), &first).expect("a file");
    let again = ser_cli()
        .current_dir(desk.0.path())
        .args(["export", "--site", "north.toml", "--input", "all.jsonl", "--format", "jsonl"])
        .output()
        .expect("ser-cli runs");
    assert_eq!(text(&again.stdout), first);
}

#[test]
fn a_part_is_chosen_as_in_a_report() {
    let desk = Desk::new();
    let sequences = |arguments: &str| -> Vec<String> {
        let csv = desk.ok(&format!("--format csv {arguments}"));
        csv.lines().skip(1).map(|row| row.split(',').nth(4).expect("a field").to_owned()).collect()
    };
    assert_eq!(sequences(""), ["1", "2", "2", "40"]);
    assert_eq!(sequences("--last-trip"), ["1", "2", "2"]);
    assert_eq!(sequences("--last"), ["2", "40"]);
    assert_eq!(sequences("--around 2026-11-22T10:00:01"), ["1", "2", "2"]);
    assert_eq!(sequences("--since 2026-11-22T10:30:00"), ["2", "40"]);
    assert_eq!(sequences("--until 2026-11-22T10:00:00.3"), ["1"]);
    let told = desk.refused("--format csv --since 2027-01-01T00:00:00", 1);
    assert!(told.contains("no entry with a time"), "{told}");
    desk.refused("--format csv --since 2027-01-01T00:00 --until 2026-01-01T00:00", 2);
}

#[test]
fn comtrade_is_three_files_and_overwrites_none() {
    let desk = Desk::new();
    desk.ok("--format comtrade -o trip.cfg");
    assert_eq!(desk.made(), ["trip.cfg", "trip.dat", "trip.hdr"]);
    let cfg = fs::read_to_string(desk.path("trip.cfg")).expect("text");
    assert!(cfg.contains("22/11/2026,09:00:00.249000\r\n"), "{cfg}");
    let hdr = fs::read_to_string(desk.path("trip.hdr")).expect("text");
    assert!(hdr.contains("MISSING: U1: 37 entries missing (overwritten)"), "{hdr}");

    fs::remove_file(desk.path("trip.cfg")).expect("removed");
    fs::write(desk.path("trip.hdr"), "theirs").expect("a file");
    let told = desk.refused("--format comtrade -o trip.cfg", 1);
    assert!(told.contains("exists, and is not overwritten"), "{told}");
    assert_eq!(desk.made(), ["trip.dat", "trip.hdr"], "nothing under the other names");
    assert_eq!(fs::read_to_string(desk.path("trip.hdr")).expect("text"), "theirs");
    desk.ok("--format comtrade -o trip.cfg --force");
    assert_eq!(desk.made(), ["trip.cfg", "trip.dat", "trip.hdr"]);
    assert_eq!(fs::read_to_string(desk.path("trip.hdr")).expect("text"), hdr);

    assert!(desk.refused("--format comtrade", 2).contains("needs a name"));
    assert!(desk.refused("--format comtrade -o trip.dat", 2).contains("-o trip.cfg"));
}

#[test]
fn a_name_can_say_what_is_in_the_file() {
    let desk = Desk::new();
    desk.ok("--format comtrade --comname ACME -o .");
    let name = "261122,090000249,0,Northfield,U1,ACME";
    let expected = ["cfg", "dat", "hdr"].map(|end| format!("{name}.{end}"));
    assert_eq!(desk.made(), expected);
    desk.ok("--format prc002 --comname ACME -o .");
    assert!(desk.made().contains(&"261122,100000249,+1,Northfield,U1,ACME.csv".to_owned()));
    assert!(desk.refused("--format csv --comname ACME -o nowhere", 2).contains("is not a folder"));
}

#[test]
fn options_of_another_format_are_refused() {
    let desk = Desk::new();
    for (arguments, format) in [
        ("--format vcd --rate 1000", "comtrade"),
        ("--format csv --data binary", "comtrade"),
        ("--format jsonl --csv-dialect excel-de", "csv"),
        ("--format vcd --csv-dialect rfc4180", "csv"),
        ("--format csv --data ascii", "comtrade"),
        ("--format csv --line-frequency 50", "comtrade"),
        ("--format vcd --spreadsheet-safe", "prc002"),
    ] {
        assert!(desk.refused(arguments, 2).contains(format), "{arguments}");
    }
    let told = desk.refused("--format cff --rate 1000", 1);
    assert!(told.contains("1 h 29 min apart") && told.contains("can hold 1 h 0 min"), "{told}");
    desk.ok("--format cff --rate 1000 --last-trip");
}

#[cfg(not(feature = "parquet"))]
#[test]
fn a_build_without_parquet_says_how_to_get_it() {
    let told = Desk::new().refused("--format parquet -o a.parquet", 2);
    assert!(told.contains("--features parquet"), "{told}");
}

#[test]
fn losses_can_be_a_failure() {
    let desk = Desk::new();
    assert_eq!(desk.run("--format csv --fail-on-loss").status.code(), Some(3));
    // Nothing is missing in the trip itself, but right after it.
    assert_eq!(desk.run("--format vcd --fail-on-loss -o a.vcd").status.code(), Some(3));
    assert_eq!(desk.made(), ["a.vcd"], "the file is there nevertheless");
}

/// Many entries, so that not all of them fit into any buffer.
fn with_much(desk: &Desk) {
    with_entries(desk, 60_000);
}

fn with_entries(desk: &Desk, entries: u32) {
    let mut rows = format!("{HEADER}\n");
    for entry in 0..entries {
        let (minute, second, ms) = (entry / 60_000, entry / 1000 % 60, entry % 1000);
        let (number, state) = (entry % 2048 + 1, entry % 2);
        let sequence = entry + 1;
        rows += &format!(
            "{number},2026-11-22T10:{minute:02}:{second:02}.{ms:03},3,{state},{sequence},\
             9f3c5a7e21b04d68,\n"
        );
    }
    fs::write(desk.path("U1.csv"), rows).expect("a file");
}

const FORMATS: [&str; 6] = ["csv", "jsonl", "vcd", "cff", "prc002", "comtrade"];

/// Every format that this build writes.
fn formats() -> impl Iterator<Item = &'static str> {
    FORMATS.into_iter().chain(cfg!(feature = "parquet").then_some("parquet"))
}

/// `ser-cli`, whose files may not grow beyond a few blocks, which is like a full disk. Unless the
/// program takes care, the signal for it ends it.
fn on_a_full_disk(desk: &Desk) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -f 64; exec \"$@\"", "sh"]).arg(env!("CARGO_BIN_EXE_ser-cli"));
    shell.current_dir(desk.0.path()).env_remove("SER_SITE").env_remove("SER_PORT");
    shell
}

#[test]
fn a_full_disk_leaves_nothing() {
    let desk = Desk::new();
    with_much(&desk);
    let entries = "--site north.toml --input U1.csv";
    let commands = formats()
        .map(|format| (format!("export {entries} --format {format} -o a.cfg"), "a."))
        .chain(
            // The whole incident as text and JSON; a page has a limit of its own.
            ["txt", "json"].map(|end| (format!("report {entries} --unfold -o a.{end}"), "a.")),
        )
        .chain([("import U1.csv -o a.jsonl".to_owned(), "a.jsonl")]);
    for (command, name) in commands {
        let mut limited = on_a_full_disk(&desk);
        let output = limited.args(command.split_whitespace()).output().expect("a shell");
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{command}: {told}");
        assert!(told.contains(&format!("cannot write {name}")), "{command}: {told}");
        assert!(told.contains("hint: "), "{command}: {told}");
        assert_eq!(desk.made(), Vec::<String>::new(), "{command}");
    }
}

/// Nothing is left, neither part nor whole, and the exit code says so.
fn assert_interrupted(desk: &Desk, mut running: Running, signal: &str) {
    running.signal(signal);
    assert_eq!(running.wait(), Some(1), "{signal}");
    let told: Vec<String> = running.told().iter().collect();
    assert!(
        told.iter().any(|line| line.contains("interrupted, and nothing is written")),
        "{told:?}"
    );
    assert_eq!(desk.made(), Vec::<String>::new(), "{signal}");
}

#[test]
fn an_interrupt_leaves_nothing_of_an_export() {
    let desk = Desk::new();
    for (format, signal) in [("jsonl", "-INT"), ("vcd", "-TERM"), ("comtrade", "-HUP")] {
        let mut entries = 300_000;
        // A fast computer may be done before the interrupt; then there has to be more to do.
        let running = loop {
            with_entries(&desk, entries);
            let mut command = desk.command(&format!("--format {format} -o a.cfg --force"));
            let mut running = Running::start(command.stderr(Stdio::piped()));
            let is_part = |name: &String| name.ends_with(".part");
            let is_begun =
                |name: String| fs::metadata(desk.path(&name)).is_ok_and(|about| about.len() > 0);
            wait_until("it writes", || {
                desk.made().into_iter().filter(is_part).any(is_begun) || desk.path("a.cfg").exists()
            });
            if running.0.try_wait().expect("a child").is_none() && !desk.path("a.cfg").exists() {
                break running;
            }
            assert_eq!(running.wait(), Some(0));
            desk.made().iter().for_each(|name| fs::remove_file(desk.path(name)).expect("removed"));
            entries *= 2;
        };
        assert_interrupted(&desk, running, signal);
    }
}

#[test]
fn an_interrupt_leaves_nothing_of_an_import_or_a_report_that_waits_for_its_input() {
    let desk = Desk::new();
    let pipe =
        desk.0.path().parent().expect("a folder").join(format!(
            "pipe-{}.csv",
            desk.0.path().file_name().expect("a name").to_string_lossy()
        ));
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    let of_pipe = pipe.display();
    for command in [
        format!("import {of_pipe} -o a.jsonl"),
        format!("report --site north.toml --input {of_pipe} -o a.html"),
        format!("export --site north.toml --input {of_pipe} --format csv -o a.csv"),
    ] {
        let mut waiting = ser_cli();
        waiting.current_dir(desk.0.path()).args(command.split_whitespace());
        let running = Running::start(waiting.stderr(Stdio::piped()));
        wait_until("it has begun", || desk.made().iter().any(|name| name.ends_with(".part")));
        assert_interrupted(&desk, running, "-INT");
    }
    fs::remove_file(&pipe).expect("removed");
}

#[test]
fn force_replaces_all_files_of_a_record_or_none() {
    let desk = Desk::new();
    for name in ["trip.cfg", "trip.dat", "trip.hdr"] {
        fs::write(desk.path(name), "theirs").expect("a file");
    }
    // Nothing can take the place of a folder that is not empty.
    fs::remove_file(desk.path("trip.cfg")).expect("removed");
    fs::create_dir_all(desk.path("trip.cfg/in")).expect("a folder");
    let told = desk.refused("--format comtrade -o trip.cfg --force", 1);
    assert!(told.contains("trip.cfg is a folder"), "{told}");
    assert_eq!(desk.made(), ["trip.cfg", "trip.dat", "trip.hdr"]);
    assert_eq!(fs::read_to_string(desk.path("trip.dat")).expect("text"), "theirs");
}

#[test]
fn a_line_means_standard_output_everywhere() {
    let desk = Desk::new();
    assert_eq!(desk.ok("--format csv -o -"), desk.ok("--format csv"));
    assert!(desk.refused("--format comtrade -o -", 2).contains("needs a name"));
    assert!(desk.refused("--format csv --comname ACME -o -", 2).contains("has no name"));
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.current_dir(desk.0.path()).args(arguments.split_whitespace());
        let output = command.output().expect("ser-cli runs");
        assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    let report = "report --site north.toml --input U1.csv --format json";
    assert_eq!(run(&format!("{report} -o -")), run(report));
    assert_eq!(run("import U1.csv -o -"), run("import U1.csv"));
    assert_eq!(desk.made(), Vec::<String>::new());
}

#[test]
fn who_names_a_file_needs_no_standard_output() {
    let desk = Desk::new();
    for command in [
        "report --site north.toml --input U1.csv -o a.html",
        "export --site north.toml --input U1.csv --format csv -o a.csv",
        "import U1.csv -o a.jsonl",
    ] {
        let mut shell = Command::new("sh");
        let closed = format!("exec \"$0\" {command} >&-");
        shell.args(["-c", &closed, env!("CARGO_BIN_EXE_ser-cli")]).current_dir(desk.0.path());
        let output = shell.output().expect("a shell");
        assert_eq!(output.status.code(), Some(0), "{command}: {}", text(&output.stderr));
    }
    assert_eq!(desk.made(), ["a.csv", "a.html", "a.jsonl"]);
}

#[test]
fn a_page_that_cannot_be_written_is_told_before_the_demo_begins() {
    let desk = Desk::new();
    for (page, told) in [("no/page.html", "there is no folder no"), ("-", "tells its story")] {
        let mut demo = ser_cli();
        demo.current_dir(desk.0.path()).args(["demo", "-o", page]);
        let output = demo.output().expect("ser-cli runs");
        assert!(text(&output.stderr).contains(told), "{}", text(&output.stderr));
        assert_ne!(output.status.code(), Some(0));
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn a_full_output_is_told() {
    let desk = Desk::new();
    with_much(&desk);
    for format in formats().filter(|format| *format != "comtrade") {
        let full = fs::File::options().write(true).open("/dev/full").expect("a device");
        let mut command = desk.command(&format!("--format {format}"));
        let output = command.stdout(full).output().expect("ser-cli runs");
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{format}: {told}");
        assert!(told.contains("cannot write standard output"), "{format}: {told}");
    }
}

#[test]
fn a_reader_that_has_enough_is_no_failure() {
    let desk = Desk::new();
    with_much(&desk);
    for format in formats().filter(|format| *format != "comtrade") {
        let mut command = desk.command(&format!("--format {format}"));
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("ser-cli runs");
        let mut out = child.stdout.take().expect("piped");
        out.read_exact(&mut [0; 10]).expect("some bytes");
        drop(out);
        let output = child.wait_with_output().expect("ended");
        assert_eq!(output.status.code(), Some(0), "{format}: {}", text(&output.stderr));
        assert_eq!(text(&output.stderr), "", "{format}");
    }
}

#[test]
fn only_a_file_is_a_place_for_a_file() {
    let desk = Desk::new();
    assert!(desk.refused("--format csv -o . --force", 1).contains("is a folder"));
    assert!(desk.refused("--format csv -o /dev/null --force", 1).contains("is not a file"));
    assert!(Path::new("/dev/null").exists());
    let told = desk.refused("--format csv -o no/such/folder.csv", 1);
    assert!(told.contains("no/such/folder.csv: there is no folder no/such\n"), "{told}");
}
