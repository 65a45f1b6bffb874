//! `export` as a user asks for it: what is written where, and what is left when that fails.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::bench::text;
use common::ser_cli;
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
    assert!(desk.refused("--format csv --comname ACME -o nowhere", 2).contains("is no folder"));
}

#[test]
fn options_of_another_format_are_refused() {
    let desk = Desk::new();
    for (arguments, format) in [
        ("--format vcd --rate 1000", "comtrade"),
        ("--format csv --data binary", "comtrade"),
        ("--format jsonl --csv-dialect excel-de", "csv"),
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
    let mut rows = format!("{HEADER}\n");
    for entry in 0..60_000 {
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

#[test]
fn a_full_disk_leaves_nothing() {
    let desk = Desk::new();
    with_much(&desk);
    for format in FORMATS {
        // No file may grow beyond a few blocks, which is told like a full disk.
        let mut shell = Command::new("sh");
        let limited = "trap '' XFSZ; ulimit -f 64; exec \"$@\"";
        shell.args(["-c", limited, "sh"]).arg(env!("CARGO_BIN_EXE_ser-cli"));
        shell.args(["export", "--site", "north.toml", "--input", "U1.csv", "--format", format]);
        let output =
            shell.args(["-o", "a.cfg"]).current_dir(desk.0.path()).output().expect("a shell");
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{format}: {told}");
        assert!(told.contains("cannot write a.") && told.contains("hint: "), "{format}: {told}");
        assert_eq!(desk.made(), Vec::<String>::new(), "{format}");
    }
}

#[test]
fn a_full_output_is_told() {
    let desk = Desk::new();
    with_much(&desk);
    for format in FORMATS.into_iter().filter(|format| *format != "comtrade") {
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
    for format in FORMATS.into_iter().filter(|format| *format != "comtrade") {
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
    desk.refused("--format csv -o no/such/folder.csv", 1);
}
