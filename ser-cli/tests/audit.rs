//! What is written down of commands that change a recorder, and how it is listed.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use common::bench::{Bench, text};
use common::original::Original;
use common::{Running, ser_cli, wait_until};
use ser_sim::testing::{Kind, PATIENCE};
use serde_json::Value;

/// The commands that are written down, oldest first.
fn audit(bench: &Bench, options: &str) -> Vec<Value> {
    let json = bench.ok(&format!("audit --format json {options}"));
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["schema"], 1);
    json["commands"].as_array().expect("a list").clone()
}

fn told(commands: &[Value]) -> Vec<(&str, &str)> {
    commands
        .iter()
        .map(|command| {
            (command["command"].as_str().expect("text"), command["outcome"].as_str().expect("text"))
        })
        .collect()
}

fn folder(bench: &Bench) -> PathBuf {
    bench.folder.path().join("state")
}

/// What the system calls the user and the computer.
fn asked(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().expect("it runs");
    text(&output.stdout).trim().to_owned()
}

#[test]
fn whoever_changes_a_recorder_is_written_down_and_whoever_reads_is_not() {
    let bench = Bench::start(Kind::Native, &[]);
    for reading in ["status", "config", "filter", "read", "read --new", "time", "last-broadcast"] {
        bench.ok(reading);
    }
    assert_eq!(audit(&bench, ""), Vec::<Value>::new());
    assert!(!folder(&bench).join("audit.jsonl").exists());

    bench.ok("clock set --at 2026-11-22T10:00:00");
    bench.ok("config --size 1024 --auto-report rs232");
    bench.ok("filter set --input 3 --debounce 5ms");
    bench.ok("stop");
    bench.ok("start");
    bench.ok("erase --yes");
    let commands = audit(&bench, "");
    assert_eq!(
        told(&commands),
        [
            ("set clock to 2026-11-22T10:00:00.000", "done"),
            (
                "configure: size 1024 entries, auto report rs232, report to 0, auto print off",
                "done"
            ),
            ("set filter of input 3: debounce 5 ms, chatter filter off", "done"),
            ("stop recording", "done"),
            ("start recording", "done"),
            ("erase the log", "done"),
        ]
    );
    let first = &commands[0];
    assert_eq!(first["user"], asked("id", &["-un"]));
    assert_eq!(first["host"], asked("uname", &["-n"]));
    assert_eq!(first["program"], concat!("ser-cli ", env!("CARGO_PKG_VERSION")));
    assert_eq!(first["peer"], bench.link().display().to_string());
    assert_eq!(first["why"], Value::Null);

    let table = bench.ok("audit");
    let row = table.lines().find(|line| line.contains("erase the log")).expect("a row");
    let who = format!("{}@{}", asked("id", &["-un"]), asked("uname", &["-n"]));
    assert!(row.contains(&who) && row.ends_with("done"), "{table}");
    let records = bench.ok("audit --format jsonl");
    assert_eq!(records, fs::read_to_string(folder(&bench).join("audit.jsonl")).unwrap());
    assert_eq!(records.lines().count(), 1 + 6);
}

#[test]
fn what_may_have_been_carried_out_and_what_was_refused_are_told_apart() {
    let recorder = Original::that_keeps_its_settings();
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_PORT", recorder.port()).env("SER_STATE_DIR", folder.path());
        let patience = ["--timeout", "200ms", "--retries", "1"];
        command.args(patience).args(arguments.split_whitespace()).output().expect("it runs")
    };
    assert!(!run("config --size 5").status.success());
    assert!(!run("erase --yes").status.success());
    let table = text(&run("audit").stdout);
    let refused = "refused: in force are size 2048 entries, line 9600 baud, auto report off, report \
                   to 0, auto print off";
    assert!(table.lines().any(|row| row.ends_with(refused)), "{table}");
    let unknown =
        "erase the log not answered, may have been carried out: no answer to \"erase\" (sent once)";
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words(&table).contains(unknown), "{table}");
}

#[test]
fn an_interrupt_before_the_answer_leaves_a_record() {
    let recorder = Original::that_says_who_it_is();
    let folder = tempfile::tempdir().unwrap();
    let command = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_PORT", recorder.port()).env("SER_STATE_DIR", folder.path());
        command.args(["--timeout", "60s"]).args(arguments.split_whitespace());
        command
    };
    let mut erase = command("erase --yes");
    let mut erase = Running::start(erase.stdout(Stdio::null()).stderr(Stdio::null()));
    wait_until("the recorder has heard it", || recorder.heard().contains('E'));
    assert_eq!(erase.interrupt(), Some(1));
    let table = text(&command("audit").output().expect("it runs").stdout);
    assert_eq!(table.lines().count(), 2, "{table}");
    let outcome = "not answered, may have been carried out: interrupted before an answer came";
    assert!(table.contains("erase the log") && table.trim_end().ends_with(outcome), "{table}");
}

#[test]
fn the_list_is_cut_by_time_and_by_recorder() {
    let bench = Bench::start(Kind::Native, &[]);
    bench.ok("stop");
    let commands = audit(&bench, "");
    let time = commands[0]["time"].as_str().expect("a time").to_owned();
    let port = bench.link().display().to_string();
    let name = commands[0]["recorder"].as_str().expect("a name").to_owned();
    for (options, count) in [
        (format!("--since {time}"), 1),
        ("--since 2200-01-01".to_owned(), 0),
        ("--until 2001-01-01".to_owned(), 0),
        (format!("--recorder {port}"), 1),
        (format!("--recorder {name}"), 1),
        ("--recorder elsewhere".to_owned(), 0),
    ] {
        assert_eq!(audit(&bench, &options).len(), count, "{options}");
    }
    let error = bench.fails(2, "audit --since 2026-11-23 --until 2026-11-22");
    assert!(error.contains("--until is before --since"), "{error}");
    let nothing = bench.run("audit --since 2200-01-01");
    assert!(nothing.status.success() && nothing.stdout.is_empty());
    assert!(text(&nothing.stderr).contains("audit.jsonl"), "{}", text(&nothing.stderr));
}

#[test]
fn watch_is_written_down_where_it_switches_reports_on_and_off_again() {
    let bench = Bench::start(Kind::Native, &[]);
    let mut command = bench.command("watch");
    let mut watch = Running::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
    let switched = |count| {
        wait_until("reports are switched", || audit(&bench, "").len() == count);
    };
    switched(1);
    assert_eq!(watch.interrupt(), Some(0));
    switched(2);
    let commands = audit(&bench, "");
    let told = told(&commands);
    assert!(told[0].0.contains("auto report rs232"), "{told:?}");
    assert!(told[1].0.contains("auto report off"), "{told:?}");
    assert!(told.iter().all(|(_, outcome)| *outcome == "done"), "{told:?}");
}

#[test]
fn a_command_is_carried_out_although_it_cannot_be_written_down() {
    let bench = Bench::start(Kind::Native, &[]);
    fs::create_dir_all(folder(&bench)).unwrap();
    fs::write(folder(&bench).join("audit.jsonl"), "a letter\n").unwrap();
    let output = bench.run("stop");
    let error = text(&output.stderr);
    assert!(output.status.success(), "{error}");
    assert!(error.contains("cannot write") && error.contains("is not written down"), "{error}");
    assert!(bench.ok("status").contains("stopped"));
    assert_eq!(fs::read_to_string(folder(&bench).join("audit.jsonl")).unwrap(), "a letter\n");
}

#[test]
fn a_broadcast_is_written_down_once_for_the_bus_and_listed_for_a_recorder_on_it() {
    let folder = tempfile::tempdir().unwrap();
    let window = folder.path().join("host");
    let mut sim = ser_cli();
    sim.arg("sim").arg("--genius").arg(&window).args(["--node", "5", "--node", "9"]);
    let mut sim = Running::start(sim.stdout(Stdio::piped()).stderr(Stdio::null()));
    let lines = sim.lines();
    for _ in 0..2 {
        lines.recv_timeout(PATIENCE).expect("the simulator answers");
    }
    let site = folder.path().join("site.toml");
    let port = |node: u8| format!("geni:{}?node={node}", window.display());
    let text_of_site = format!(
        "site = \"N\"\ntime_zone = \"Europe/Berlin\"\n\
         [[recorder]]\nname = \"U5\"\nport = \"{}\"\n[[recorder]]\nname = \"U9\"\nport = \"{}\"\n\
         [[recorder]]\nname = \"F3\"\nport = \"/dev/ttyS7\"\n",
        port(5),
        port(9)
    );
    fs::write(&site, text_of_site).unwrap();
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_STATE_DIR", folder.path().join("state")).env("SER_SITE", &site);
        let arguments = arguments.split_whitespace();
        command.args(["--timeout", "60s"]).args(arguments).output().expect("ser-cli runs")
    };
    let ok = |arguments: &str| {
        let output = run(arguments);
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    ok("genius broadcast stop");
    ok("--recorder U5 start");
    let list = |options: &str| {
        let json: Value =
            serde_json::from_str(&ok(&format!("audit --format json {options}"))).unwrap();
        let of = |command: &Value| {
            ["recorder", "command", "outcome"].map(|key| command[key].as_str().unwrap().to_owned())
        };
        json["commands"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let bus = format!("geni:{}", window.display());
    let broadcast = [bus.as_str(), "broadcast: stop recording", "sent"].map(str::to_owned);
    let start = ["U5", "start recording", "done"].map(str::to_owned);
    assert_eq!(list(""), [broadcast.clone(), start.clone()]);
    assert_eq!(list("--recorder U5"), [broadcast.clone(), start]);
    assert_eq!(list("--recorder U9"), [broadcast]);
    assert!(list("--recorder F3").is_empty());
}

/// Every way to a recorder is opened in one file, which gives it its hook.
#[test]
fn connections_are_opened_in_one_place() {
    fn files(folder: &std::path::Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => files(&path, found),
                false => found.push(path),
            }
        }
    }
    let mut all = Vec::new();
    files(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src"), &mut all);
    let opens = ["Unit::open", "Unit::new(", "Unit::with_clock(", ".unit(", "GeniHost::open"];
    let mut found: Vec<String> = Vec::new();
    for path in all {
        let source = fs::read_to_string(&path).unwrap();
        if opens.iter().any(|open| source.contains(open)) {
            found.push(path.file_name().unwrap().to_string_lossy().into_owned());
        }
    }
    assert_eq!(found, ["connection.rs"]);
}
