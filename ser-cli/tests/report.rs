//! `report` and `merge` as a user asks for them: from recorders on a line, and from files.
#![cfg(unix)]

mod common;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;

use common::bench::{Bench, text};
use common::{Running, ser_cli, wait_until};
use ser_console::is_obeyed;
use ser_proto::{Command as Asked, Decoded, FrameDecoder, MAX_BODY_LEN};
use ser_sim::testing::{Kind, PATIENCE};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with a site file and whatever a test puts there.
struct Desk(TempDir);

impl Desk {
    fn new() -> Desk {
        Desk(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn file(&self, name: &str, content: &str) -> &Desk {
        fs::write(self.path(name), content).expect("a file");
        self
    }

    /// A site of these recorders, each with its port.
    fn site(&self, recorders: &[(&str, &str)]) -> &Desk {
        let mut site = String::from("site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n");
        site += "[incident]\nquiet_s = 3600\n";
        for (name, port) in recorders {
            write!(site, "[[recorder]]\nname = \"{name}\"\nclock = \"utc\"\n").expect("text");
            if !port.is_empty() {
                writeln!(site, "port = \"{port}\"").expect("text");
            }
        }
        self.file("north.toml", &site)
    }

    /// A command in this folder, which also remembers here.
    fn command(&self, arguments: &str) -> Command {
        let mut command = ser_cli();
        command.current_dir(self.0.path()).env("SER_STATE_DIR", self.path("state"));
        command.args(arguments.split_whitespace());
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

    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.ok(&format!("{arguments} --format json"))).expect("JSON")
    }
}

/// A recorder on TCP whose line takes its time, and whose contacts are moved through its standard input.
struct OnTcp {
    sim: Running,
    port: String,
}

impl OnTcp {
    fn start() -> OnTcp {
        let mut command = ser_cli();
        command.args(["sim", "--tcp", "127.0.0.1:0", "--paced", "--contacts", "-"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut sim = Running::start(&mut command);
        let port = sim.lines().recv_timeout(PATIENCE).expect("a port");
        OnTcp { sim, port }
    }

    /// So many events, and they are in the log when this returns.
    fn records(&mut self, events: u32) {
        let mut scenario = String::from("ms,input,state\n");
        for event in 0..events {
            let (input, state) = (event % 8 + 1, 1 - event / 8 % 2);
            writeln!(scenario, "{},{input},{state}", event * 3).expect("text");
        }
        let input = self.sim.0.stdin.as_mut().expect("piped");
        writeln!(input, "{scenario}").expect("the simulator reads");
        let told = format!("events          {events} since");
        wait_until("the contacts have moved", || {
            let status = ser_cli().args(["-p", &self.port, "status"]).output();
            text(&status.expect("ser-cli runs").stdout).contains(&told)
        });
    }
}

/// A cable to a recorder, on which is seen what hosts ask.
struct Tap {
    port: String,
    asked: Arc<Mutex<Vec<u8>>>,
}

impl Tap {
    fn on(recorder: &OnTcp) -> Tap {
        let address = recorder.port.strip_prefix("tcp://").expect("TCP").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = format!("tcp://{}", listener.local_addr().expect("an address"));
        let asked = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&asked);
        thread::spawn(move || {
            for host in listener.incoming().map_while(Result::ok) {
                let unit = TcpStream::connect(&address).expect("the simulator answers");
                carry(&host, &unit, &seen);
            }
        });
        Tap { port, asked }
    }

    /// The commands that were seen.
    fn commands(&self) -> Vec<Asked> {
        let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
        let mut commands = Vec::new();
        for &byte in self.asked.lock().expect("no panic").iter() {
            if let Some(Decoded::Frame(body)) = decoder.push(byte) {
                commands.push(Asked::parse(body).expect("a command"));
            }
        }
        commands
    }
}

fn carry(host: &TcpStream, unit: &TcpStream, seen: &Mutex<Vec<u8>>) {
    thread::scope(|scope| {
        scope.spawn(|| {
            let (mut from, mut to) = (unit, host);
            let _ = std::io::copy(&mut from, &mut to);
            let _ = host.shutdown(Shutdown::Both);
        });
        let (mut from, mut to, mut bytes) = (host, unit, [0; 256]);
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            seen.lock().expect("no panic").extend(&bytes[..count]);
            if to.write_all(&bytes[..count]).is_err() {
                break;
            }
        }
        let _ = unit.shutdown(Shutdown::Both);
    });
}

/// Recorder, sequence, input and state of each row of a report in JSON.
fn rows(report: &Value) -> Vec<(String, u64, u64, bool)> {
    let rows = report["sequence"].as_array().expect("rows").iter();
    rows.map(|row| {
        (
            row["recorder"].as_str().expect("a name").to_owned(),
            row["sequence"].as_u64().expect("a number"),
            row["input"].as_u64().expect("a number"),
            row["on"].as_bool().expect("a state"),
        )
    })
    .collect()
}

#[test]
fn one_command_reads_both_recorders_and_asks_for_no_more_than_their_logs() {
    const EVENTS: u32 = 100;
    let mut recorders = [OnTcp::start(), OnTcp::start()];
    let taps = [Tap::on(&recorders[0]), Tap::on(&recorders[1])];
    let desk = Desk::new();
    desk.site(&[("U1", &taps[0].port), ("U2", &taps[1].port)]);
    for name in ["U1", "U2"] {
        desk.ok(&format!("config --site north.toml --line-baud 19200 --recorder {name}"));
        desk.ok(&format!("clock set --site north.toml --baud 19200 --recorder {name}"));
    }
    for recorder in &mut recorders {
        recorder.records(EVENTS);
    }
    taps.iter().for_each(|tap| tap.asked.lock().expect("no panic").clear());

    let report = desk.json("report --site north.toml --timeout 20s --fail-on-loss");
    let each: BTreeSet<(String, u64)> =
        rows(&report).into_iter().map(|(name, sequence, ..)| (name, sequence)).collect();
    let of = |name: &'static str| {
        (1..=u64::from(EVENTS)).map(move |sequence| (name.to_owned(), sequence))
    };
    let expected: BTreeSet<(String, u64)> = ["U1", "U2"].into_iter().flat_map(of).collect();
    assert_eq!(each, expected);
    assert_eq!(
        (&report["is_incomplete"], &report["not_reached"]),
        (&false.into(), &Value::Array(vec![]))
    );

    for tap in &taps {
        let commands = tap.commands();
        let (mut entries, mut questions) = (0, 0);
        for command in &commands {
            match command {
                Asked::Read { count, .. } => entries += u32::from(*count),
                Asked::QueryConfiguration => {}
                // What the clock shows, and whether changes were left out of the log.
                Asked::Identify | Asked::Time { .. } | Asked::Diagnostics { .. } => questions += 1,
                // Nothing that is asked changes anything.
                other => panic!("{other:?}"),
            }
        }
        assert!((EVENTS..=EVENTS + 10).contains(&entries), "{entries}: {commands:?}");
        assert!(commands.len() - questions <= 20 && questions <= 6 + 4, "{commands:?}");
    }
}

#[test]
fn a_recorder_that_cannot_be_reached_is_named_and_the_report_is_made_from_the_other() {
    let mut recorder = OnTcp::start();
    let desk = Desk::new();
    desk.site(&[("U1", &recorder.port), ("U2", "tcp://127.0.0.1:1")]);
    recorder.records(3);

    let output = desk.run("report --site north.toml --timeout 20s");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let (report, told) = (text(&output.stdout), text(&output.stderr));
    assert!(told.contains("warning: U2: nothing listens at tcp://127.0.0.1:1"), "{told}");
    assert!(report.contains("U2 not reached"), "{report}");
    assert!(report.contains("\nnot reached U2: nothing listens at"), "{report}");
    assert!(report.contains("first-out"), "{report}");

    let report = desk.json("report --site north.toml --timeout 20s");
    assert_eq!(rows(&report).len(), 3);
    assert_eq!(report["not_reached"][0]["recorder"], "U2");
    for strict in ["report", "merge"] {
        let strict = desk.run(&format!("{strict} --site north.toml --timeout 20s --fail-on-loss"));
        assert_eq!(strict.status.code(), Some(3), "{strict:?}");
        assert!(!strict.stdout.is_empty(), "what could be read is delivered");
    }
    // Files remember it.
    let list = desk.ok("merge --site north.toml --timeout 20s");
    assert!(
        list.lines().last().is_some_and(|row| row.contains("U2") && row.ends_with("not reached"))
    );
    for format in ["csv", "jsonl"] {
        let file = format!("all.{format}");
        let all = desk.ok(&format!("merge --site north.toml --timeout 20s --format {format}"));
        let report = desk.file(&file, &all).ok(&format!("report --site north.toml --input {file}"));
        assert!(report.contains("\nnot reached U2: not reached when the file was"), "{report}");
        let strict = desk.run(&format!("report --site north.toml --fail-on-loss --input {file}"));
        assert_eq!(strict.status.code(), Some(3), "{strict:?}");
    }
    desk.file("U2.jsonl", &format!("{HEAD}{}", entry("U2", 1, "2026-11-22T10:00:00.100", 1, "1")));
    let report = desk.ok("report --site north.toml --input all.jsonl U2.jsonl");
    assert!(!report.contains("not reached"), "another file has read it: {report}");
}

#[test]
fn a_list_as_csv_is_read_as_what_it_was_made_from() {
    let desk = Desk::new();
    three_files(&desk);
    let list = desk.ok("merge --site north.toml --input a.jsonl b.jsonl U2.csv --format csv");
    desk.file("all.csv", &list);
    assert_eq!(desk.ok("merge --site north.toml --input all.csv --format csv"), list);
    let of = |files: &str| rows(&desk.json(&format!("report --site north.toml --input {files}")));
    assert_eq!(of("all.csv"), of("a.jsonl b.jsonl U2.csv"));
}

#[test]
fn readings_that_nobody_can_put_together_are_told() {
    let desk = Desk::new();
    let header = "entry,time,input,state,sequence,life,note\n";
    let row = |at: u32| format!("{at},2026-11-22T10:00:0{at}.000,1,1,{at},0,\n");
    desk.site(&[("U1", "")]);
    for (files, told) in [
        ("early/U1.csv late/U1.csv", "U1: 2 readings have no entry in common"),
        (
            "early/U1.csv old/U1.csv",
            "U1: a file without sequence numbers stands beside other files",
        ),
        ("early/U1.csv both/U1.csv", ""),
    ] {
        for (folder, text) in [
            ("early", format!("{header}{}", row(1))),
            ("late", format!("{header}{}", row(2))),
            ("both", format!("{header}{}{}", row(1), row(2))),
            ("old", "entry,time,input,state\n1,2026-11-22T10:00:01.000,1,1\n".to_owned()),
        ] {
            fs::create_dir_all(desk.path(folder)).expect("a folder");
            desk.file(&format!("{folder}/U1.csv"), &text);
        }
        let output = desk.run(&format!("merge --site north.toml --input {files}"));
        let warnings = text(&output.stderr);
        assert_eq!(warnings.contains("warning: "), !told.is_empty(), "{warnings}");
        assert!(warnings.contains(told), "{warnings}");
    }
}

/// An entry of a life as JSON lines have it.
fn entry(recorder: &str, sequence: u32, time: &str, changed: u8, state: &str) -> String {
    let recorder = serde_json::to_string(recorder).expect("a text");
    format!(
        "{{\"record\":\"entry\",\"recorder\":{recorder},\"entry\":{sequence},\"time\":\"{time}\",\
         \"changed\":[{changed}],\"state\":[{state}],\"sequence\":{sequence},\
         \"life\":\"9f3c5a7e21b04d68\"}}\n"
    )
}

const HEAD: &str = "{\"record\":\"file\",\"schema\":1,\"program\":\"ser-cli 0.1.0\"}\n";

/// What two recorders have of an incident, in three files of two kinds; one entry is in two of them.
fn three_files(desk: &Desk) {
    let early = entry("U1", 1, "2026-11-22T10:00:00.100", 1, "1");
    let shared = entry("U1", 2, "2026-11-22T10:00:00.117", 2, "1,2");
    let late = entry("U1", 4, "2026-11-22T10:00:00.200", 1, "2");
    desk.site(&[("U1", ""), ("U2", "")])
        .file("a.jsonl", &format!("{HEAD}{early}{shared}"))
        .file("b.jsonl", &format!("{HEAD}{shared}{late}"))
        .file(
            "U2.csv",
            "entry,time,input,state,sequence,life,note\n\
             7,2026-11-22T10:00:00.117,3,1,7,0,\n8,2026-11-22T10:00:00.150,3,0,8,0,\n",
        );
}

#[test]
fn the_order_of_files_and_the_zone_of_the_computer_change_no_byte() {
    let desk = Desk::new();
    three_files(&desk);
    for command in
        ["report", "report --format json", "merge", "merge --format csv", "merge --format jsonl"]
    {
        let mut outputs = BTreeSet::new();
        for files in
            ["a.jsonl b.jsonl U2.csv", "U2.csv b.jsonl a.jsonl", "b.jsonl U2.csv a.jsonl b.jsonl"]
        {
            for zone in ["UTC", "Asia/Kolkata", "America/New_York"] {
                let mut command =
                    desk.command(&format!("{command} --site north.toml --input {files}"));
                let output = command.env("TZ", zone).output().expect("ser-cli runs");
                assert_eq!(output.status.code(), Some(0), "{output:?}");
                outputs.insert(text(&output.stdout));
            }
        }
        assert_eq!(outputs.len(), 1, "{command}: {outputs:#?}");
    }
    let report = desk.json("report --site north.toml --input a.jsonl b.jsonl U2.csv");
    assert_eq!(rows(&report).len(), 5);
}

#[test]
fn a_list_of_all_records_gives_the_report_that_its_sources_give() {
    let desk = Desk::new();
    three_files(&desk);
    let all = desk.ok("merge --site north.toml --input a.jsonl b.jsonl U2.csv --format jsonl");
    desk.file("all.jsonl", &all);
    let report = |files: &str| desk.ok(&format!("report --site north.toml --input {files}"));
    assert_eq!(report("all.jsonl"), report("a.jsonl b.jsonl U2.csv"));
}

#[test]
fn csv_and_json_lines_of_one_reading_give_the_same_sequence() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.contacts("0,3,1\n0,4,1\n7,3,0\n9,5,1\n9,4,0", 3);
    let desk = Desk::new();
    desk.site(&[("U1", bench.link().to_str().expect("UTF-8"))]);
    for (format, file) in [("csv", "U1.csv"), ("jsonl", "other.jsonl")] {
        let read = desk.ok(&format!("read --site north.toml --recorder U1 --format {format}"));
        desk.file(file, &read);
    }
    let of = |file: &str| rows(&desk.json(&format!("report --site north.toml --input {file}")));
    assert_eq!(of("U1.csv").len(), 5);
    assert_eq!(of("U1.csv"), of("other.jsonl"));
}

#[test]
fn a_file_that_was_read_without_the_site_gets_its_names() {
    let desk = Desk::new();
    let early = entry("tcp://localhost:4001", 1, "2026-11-22T10:00:00.100", 1, "1");
    desk.site(&[("U1", "tcp://127.0.0.1:4001")]).file("a.jsonl", &format!("{HEAD}{early}"));
    let report = desk.json("report --site north.toml --input a.jsonl");
    assert_eq!(rows(&report)[0].0, "U1");
}

/// Whether a terminal shows all of this and obeys none of it.
fn is_harmless(shown: &str) -> bool {
    !shown.contains(|letter| letter != '\n' && is_obeyed(letter))
}

#[test]
fn hostile_names_never_reach_the_terminal() {
    let long = "n".repeat(200);
    let names = ["A\u{1b}[2J\u{7}", "B\u{202e}lave\u{2066}\u{9b}1m", "C\r\nfirst-out", &long];
    let desk = Desk::new();
    let lines: String = names
        .iter()
        .map(|name| entry(name, 1, "2026-11-22T10:00:00.100", 1, "1"))
        .chain([format!("{{\"record\":\"entry\",\"recorder\":\"{}\n", names[1])])
        .collect();
    desk.file("a.jsonl", &format!("{HEAD}{lines}"));
    for command in
        ["report", "report --format json", "merge", "merge --format csv", "merge --format jsonl"]
    {
        let output = desk.run(&format!("{command} --input a.jsonl"));
        let (shown, told) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{command}: {told}");
        assert!(shown.contains(&long), "{command}: {shown}");
        assert!(is_harmless(&shown) && is_harmless(&told), "{command}: {shown:?} {told:?}");
        assert!(!shown.contains("\nfirst-out\""), "{command}: {shown}");
    }
    // Points are named in the site file, which may not have such names at all.
    desk.file(
        "hostile.toml",
        "site = \"N\"\ntime_zone = \"UTC\"\n[[recorder]]\nname = \"U1\"\n[[point]]\n\
         recorder = \"U1\"\ninput = 1\nname = \"52\u{202e}1\\u001b[2J\"\n",
    );
    let refused = desk.run("report --site hostile.toml --input a.jsonl");
    let told = text(&refused.stderr);
    assert_eq!((refused.status.code(), refused.stdout.len()), (Some(1), 0));
    assert!(told.contains("error[hidden-character]") && is_harmless(&told), "{told:?}");
}

#[test]
fn damaged_lines_are_told_and_passed_over() {
    let desk = Desk::new();
    let whole = entry("U1", 1, "2026-11-22T10:00:00.100", 1, "1");
    let (other, cut) = (entry("U1", 2, "2026-11-22T10:00:00.117", 2, "1,2"), &whole[..40]);
    desk.file("a.jsonl", &format!("{HEAD}{whole}{cut}\n{other}{cut}\n{cut}\n{cut}\n{cut}\n"));
    for command in ["report", "merge"] {
        let output = desk.run(&format!("{command} --input a.jsonl"));
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{told}");
        assert!(told.contains("warning: a.jsonl: line 3, byte "), "{told}");
        assert!(told.contains("; the line is left out\n"), "{told}");
        assert!(told.contains("warning: a.jsonl: 2 more damaged lines\nhint: "), "{told}");
        assert!(text(&output.stdout).contains("input 2"), "{output:?}");
        assert!(text(&output.stdout).contains("could not be read"), "{output:?}");
        let strict = desk.run(&format!("{command} --input a.jsonl --fail-on-loss"));
        assert_eq!((strict.status.code(), &strict.stdout), (Some(3), &output.stdout));
    }
    let report = desk.json("report --input a.jsonl");
    assert_eq!((&report["is_incomplete"], &report["damaged_lines"]), (&true.into(), &5.into()));
    // What was merged from it says so, too.
    for format in ["jsonl", "csv"] {
        let merged = desk.ok(&format!("merge --input a.jsonl --format {format}"));
        let file = format!("merged.{format}");
        let report = desk.file(&file, &merged).ok(&format!("report --input {file}"));
        assert!(report.contains("(a line could not be read)"), "{report}");
        let strict = desk.run(&format!("report --input {file} --fail-on-loss"));
        assert_eq!(strict.status.code(), Some(3), "{strict:?}");
    }
}

#[test]
fn what_is_missing_ends_with_its_own_code_if_that_is_wanted() {
    let desk = Desk::new();
    three_files(&desk);
    for command in ["report", "merge", "merge --format csv"] {
        let of = |more: &str| {
            desk.run(&format!("{command} --site north.toml --input a.jsonl b.jsonl {more}"))
        };
        assert_eq!(of("").status.code(), Some(0));
        let strict = of("--fail-on-loss");
        assert_eq!(strict.status.code(), Some(3), "{strict:?}");
        assert_eq!(strict.stdout, of("").stdout);
        assert!(text(&strict.stderr).contains("missing") || text(&strict.stderr).contains("gaps"));
    }
}

#[test]
fn every_mistake_is_told_with_what_to_do_next() {
    let desk = Desk::new();
    three_files(&desk);
    desk.file("empty", "").file("other.txt", "hello\n").file("bad.toml", "site = 7\n");
    fs::create_dir(desk.path("folder")).expect("a folder");
    let too_new = "{\"record\":\"file\",\"schema\":99,\"program\":\"x\"}\n";
    desk.file("new.jsonl", too_new);
    let wide: Vec<u8> = "\u{FEFF}{".encode_utf16().flat_map(u16::to_le_bytes).collect();
    fs::write(desk.path("wide.jsonl"), wide).expect("a file");
    for (arguments, code, told) in [
        ("report", 2, "from where? There is neither --site nor --input"),
        ("merge", 2, "from where? There is neither --site nor --input"),
        ("report --site north.toml", 2, "no recorder of the site has a port"),
        ("report --input a.jsonl --around yesterday", 2, "not a date and time like 2026-"),
        ("report --input a.jsonl --since 2026-13-01", 2, "not a date and time like 2026-"),
        ("report --input a.jsonl --last --around 2026-11-22", 2, "cannot be used with"),
        (
            "report --site north.toml --input a.jsonl --around 2026-10-25T02:30",
            2,
            "is twice or never in Europe/Berlin\nhint: add the offset from UTC",
        ),
        (
            "report --input a.jsonl --since 2026-11-23 --until 2026-11-21",
            2,
            "--until is before --since\nhint: ",
        ),
        (
            "report --input a.jsonl --since 2030-01-01",
            1,
            "there is no entry in this time\nhint: ser-cli merge",
        ),
        ("report --input empty", 1, "there is no entry in what was read\nhint: "),
        ("report --site bad.toml --input a.jsonl", 1, "error: bad.toml has 2 errors\nhint: "),
        ("report --site none.toml --input a.jsonl", 1, "cannot read none.toml: "),
        ("report --input folder", 1, "folder is a folder\nhint: name the files in it"),
        ("report --input a.jsonl none.jsonl", 1, "cannot read none.jsonl: "),
        ("report --input a.jsonl --recorder U1", 2, "--recorder U1 says which recorder is read"),
        (
            "merge --site north.toml --input a.jsonl --recorder U1",
            2,
            "or say it with ser-cli import",
        ),
        ("report --input wide.jsonl", 1, "this is UTF-16"),
        ("merge --input wide.jsonl", 1, "hint: make it one of ours with ser-cli import wide.jsonl"),
        ("merge --input other.txt", 1, "neither JSON lines nor CSV"),
        ("merge --input new.jsonl", 1, "written by a later version"),
    ] {
        let output = desk.run(arguments);
        let error = text(&output.stderr);
        assert_eq!(
            (output.status.code(), output.stdout.len()),
            (Some(code), 0),
            "{arguments}: {error}"
        );
        assert!(error.contains(told), "{arguments}: {error}");
        assert!(error.contains("hint: ") || error.contains("--help"), "{arguments}: {error}");
    }
    // An empty log is none: its list is empty, too.
    assert_eq!(desk.ok("merge --input empty --format csv").lines().count(), 1);
}
