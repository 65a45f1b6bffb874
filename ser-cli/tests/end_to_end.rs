//! The command line as a user types it, against simulated recorders: the native one and the ARM
//! image.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use common::bench::{Bench, text};
use common::{Running, events, ser_cli, wait_until};
use ser_sim::testing::{Kind, PATIENCE, image};
use ser_sim::with_both_kinds;

with_both_kinds! {
    contacts_are_recorded_and_read_back_in_every_format,
    read_new_delivers_each_event_once_and_says_what_is_lost,
    every_other_command_does_what_it_says,
    watch_shows_events_as_they_happen_and_puts_the_configuration_back,
}

fn contacts_are_recorded_and_read_back_in_every_format(kind: Kind) {
    let mut bench = Bench::start(kind, &["--model", "ser160"]);
    assert_eq!(bench.ok("read --format csv"), "entry,time,input,state,sequence,life,note\n");
    let set = bench.ok("clock set --at 2026-11-22T10:00:00");
    assert_eq!(set, "2026-11-22T10:00:00.000\n");
    bench.contacts("0,3,1\n250,16,1\n250,1,1\n251,3,0", 3);

    let csv = bench.ok("read --format csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0], ["entry", "time", "input", "state", "sequence", "life", "note"]);
    let changes: Vec<_> = rows[1..].iter().map(|row| (row[0], row[2], row[3], row[4])).collect();
    let expected =
        [("1", "3", "1", "1"), ("2", "1", "1", "2"), ("2", "16", "1", "2"), ("3", "3", "0", "3")];
    assert_eq!(changes, expected);
    assert!(rows[1..].iter().all(|row| row[5..] == ["0", ""]), "no memory, no life: {csv}");
    assert!(rows[1][1].starts_with("2026-11-22T10:0"), "{csv}");

    let times: Vec<_> = [1, 2, 4].map(|row: usize| rows[row][1]).to_vec();
    let jsonl = bench.ok("read --format jsonl --from 2 --count 2");
    let expected = format!(
        "{{\"entry\":2,\"time\":\"{}\",\"changed\":[1,16],\"state\":[1,3,16],\"sequence\":null,\"life\":\"0\"}}\n\
         {{\"entry\":3,\"time\":\"{}\",\"changed\":[3],\"state\":[1,16],\"sequence\":null,\"life\":\"0\"}}",
        times[1], times[2]
    );
    assert_eq!(events(&jsonl).join("\n"), expected);

    let table = bench.ok("read");
    for (line, time) in table.lines().skip(1).zip(&times) {
        assert!(line.contains(time), "{table}");
    }
    if kind == Kind::Native {
        assert!(
            table.contains("+0.250 s") && table.contains("+0.001 s") && table.contains("+0.251 s"),
            "{table}"
        );
    }
}

fn read_new_delivers_each_event_once_and_says_what_is_lost(kind: Kind) {
    let mut bench = Bench::start(kind, &[]);
    bench.ok("config --size 8");
    bench.contacts("0,1,1\n1,2,1\n2,3,1", 3);
    assert_eq!(events(&bench.ok("read --new --format jsonl")).len(), 3);
    assert!(events(&bench.ok("read --new --format jsonl")).is_empty());
    // Twenty more events into eight entries: twelve are overwritten.
    let steps: Vec<_> =
        (0..20).map(|index| format!("{},5,{}", 2 * index, (index + 1) % 2)).collect();
    bench.contacts(&steps.join("\n"), 5);
    wait_until("all have moved", || bench.ok("status").contains("23 since"));
    let output = bench.run("read --new --format jsonl");
    let events_read = events(&text(&output.stdout));
    assert_eq!((output.status.code(), events_read.len()), (Some(0), 1 + 8));
    let first = &events_read[0];
    let loss = "{\"lost\":12,\"count\":\"exactly\",\"after\":3,\"why\":\"overwritten\",";
    assert!(first.starts_with(loss), "{first}");
    let lost = "12 events were overwritten before they were read";
    assert!(text(&output.stderr).contains(lost), "{}", text(&output.stderr));
    assert!(events(&bench.ok("read --new --format jsonl")).is_empty());
}

fn every_other_command_does_what_it_says(kind: Kind) {
    let mut bench = Bench::start(kind, &[]);
    let status = bench.ok("status");
    assert!(
        status.contains("recording") && status.contains("0.10") && status.contains("2048"),
        "{status}"
    );

    assert!(bench.ok("config").contains("9600"));
    let config = bench.ok("config --size 1024 --auto-report genius --report-to 1");
    let shown: Vec<Vec<&str>> = config.lines().map(|line| line.split("  ").collect()).collect();
    let shown: Vec<_> =
        shown.iter().map(|words| (words[0], words[words.len() - 1].trim())).collect();
    let expected = [
        ("size", "1024 entries"),
        ("line baud", "9600"),
        ("auto report", "genius"),
        ("report to", "1"),
        ("auto print", "off"),
    ];
    assert_eq!(shown, expected);
    assert_eq!(bench.ok("config"), config);
    bench.ok("config --auto-report off");

    bench.ok("stop");
    assert!(bench.ok("status").contains("stopped"));
    bench.ok("start");
    bench.contacts("0,1,1\n5,32,1", 2);

    let printed = bench.ok("print --from 1 --count 2");
    let lines: Vec<_> = printed.lines().collect();
    assert!(lines[0].starts_with("0001 ") && lines[0].ends_with("  1 ON"), "{printed}");
    assert!(lines[1].starts_with("0002 ") && lines[1].ends_with("  32 ON"), "{printed}");

    assert!(bench.ok("last-broadcast").contains("none"));

    let refused = bench.fails(2, "erase");
    assert!(refused.contains("--yes"), "{refused}");
    assert_eq!(bench.entries(), 2);
    let erased = text(&bench.run("erase --yes").stderr);
    assert!(erased.contains("2 events"), "{erased}");
    assert_eq!(bench.entries(), 0);

    let changed = text(&bench.run("config --line-baud 19200").stderr);
    assert!(changed.contains("add --baud 19200"), "{changed}");
    assert!(bench.ok("--baud 19200 status").contains("19200"));
    bench.ok("--baud 19200 config --line-baud 9600");
}

fn watch_shows_events_as_they_happen_and_puts_the_configuration_back(kind: Kind) {
    let mut bench = Bench::start(kind, &[]);
    let before = bench.ok("config");
    bench.contacts("0,1,1", 1);
    let mut watch = Running::start(
        bench.command("watch --format csv").stdout(Stdio::piped()).stderr(Stdio::null()),
    );
    let lines = watch.lines();
    let next = || lines.recv_timeout(PATIENCE).expect("a line of watch");
    assert_eq!(next(), "entry,time,input,state,sequence,life,note");
    let change = || next().split(',').skip(2).take(3).collect::<Vec<_>>().join(",");
    assert_eq!(change(), "1,1,1");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    input.write_all(b"ms,input,state\n0,2,1\n3,1,0\n\n").expect("the simulator reads");
    assert_eq!(change(), "2,1,2");
    assert_eq!(change(), "1,0,3");
    assert_eq!(watch.interrupt(), Some(0));
    assert_eq!(bench.ok("config"), before);
    // What watch has shown is no longer new.
    assert!(events(&bench.ok("read --new --format jsonl")).is_empty());
}

#[test]
fn the_link_goes_with_the_simulator() {
    let mut bench = Bench::start(Kind::Native, &[]);
    assert_eq!(bench.sim.interrupt(), Some(0));
    assert!(!bench.link().exists() && fs::symlink_metadata(bench.link()).is_err());
}

#[test]
fn what_a_killed_simulator_has_left_behind_is_taken_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let (link, window) = (folder.path().join("ser"), folder.path().join("host"));
    let mut command = ser_cli();
    command.args(["sim", "--node", "5", "--pty"]).arg(&link).arg("--genius").arg(&window);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let start = |command: &mut Command| {
        let mut sim = Running::start(command);
        assert_eq!(
            sim.told().recv_timeout(PATIENCE).ok().as_deref(),
            Some("the simulated recorder answers; Ctrl-C switches it off")
        );
        sim
    };
    for _ in 0..3 {
        let mut sim = start(&mut command);
        sim.signal("-KILL");
        sim.wait();
        assert!(fs::symlink_metadata(&link).is_ok() && window.exists());
    }
    // A file that somebody else has put there meanwhile is kept.
    fs::remove_file(&window).expect("removed");
    fs::write(&window, [0xA5; 16_384]).expect("written");
    let refused = command.output().expect("ser-cli runs");
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("host exists already"), "{}", text(&refused.stderr));
    assert!(fs::read(&window).expect("read").iter().all(|&byte| byte == 0xA5));
    fs::remove_file(&window).expect("removed");
    assert_eq!(start(&mut command).interrupt(), Some(0));
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
}

#[test]
fn a_unit_over_tcp_answers_like_one_on_a_port() {
    let mut sim = Running::start(
        ser_cli()
            .args(["sim", "--tcp", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null()),
    );
    let port = sim.lines().recv_timeout(PATIENCE).expect("what to give to --port");
    assert!(port.starts_with("tcp://127.0.0.1:"), "{port}");
    let status = ser_cli()
        .args(["--timeout", "20s", "--port", &port, "status"])
        .output()
        .expect("ser-cli runs");
    assert!(text(&status.stdout).contains("recording"), "{}", text(&status.stderr));
}

/// A simulator on TCP, its port, and what it tells.
fn sim_on_tcp(options: &[&str]) -> (Running, String, Receiver<String>) {
    let mut command = ser_cli();
    command.args(["sim", "--tcp", "127.0.0.1:0"]).args(options);
    let mut sim = Running::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()));
    let port = sim.lines().recv_timeout(PATIENCE).expect("a port");
    let told = sim.told();
    (sim, port, told)
}

fn status_of(port: &str) -> Output {
    ser_cli().args(["status", "--port", port]).output().expect("ser-cli runs")
}

fn connected(port: &str) -> TcpStream {
    TcpStream::connect(port.strip_prefix("tcp://").expect("TCP")).expect("connected")
}

#[test]
fn a_second_client_hears_of_the_first() {
    let (_sim, port, told) = sim_on_tcp(&[]);
    let first = connected(&port);
    let refused = status_of(&port);
    let why = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1));
    assert!(why.contains("before the first answer") && why.contains("another client"), "{why}");
    let has = format!("{} has the line", first.local_addr().expect("an address"));
    let mut said = String::new();
    connected(&port).read_to_string(&mut said).expect("text");
    assert_eq!(said, format!("busy: {has}\r\n"));
    wait_until("the notice", || told.try_iter().any(|line| line.ends_with(&has)));
    drop(first);
    wait_until("the place is free", || status_of(&port).status.success());
}

#[test]
fn a_client_that_says_nothing_gives_way_in_the_end() {
    let (_sim, port, told) = sim_on_tcp(&["--tcp-idle", "1s"]);
    let silent = connected(&port);
    wait_until("the place is free", || status_of(&port).status.success());
    let gives_way =
        format!("warning: {} has been silent", silent.local_addr().expect("an address"));
    wait_until("the notice", || told.try_iter().any(|line| line.starts_with(&gives_way)));
}

#[test]
fn an_address_whose_host_is_not_known_is_told_apart() {
    let output =
        ser_cli().args(["sim", "--tcp", "no-such-host.invalid:4000"]).output().expect("runs");
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(
        error.contains("no host of this name") && error.contains("hint: check the spelling"),
        "{error}"
    );
}

#[test]
fn a_wrong_contacts_file_is_refused_with_file_line_and_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("trip.csv");
    let wrong = [
        ("input,ms,state\n0,1,1\n", 1),
        ("ms,input,state\n0,1,1\n5,33,1\n", 3),
        ("ms,input,state\n0,1,2\n", 2),
        ("ms,input,state\n10,1,1\n9,1,0\n", 3),
        ("ms,input,state\n0,1\n", 2),
        ("ms,input,state\nsoon,1,1\n", 2),
    ];
    for (content, line) in wrong {
        fs::write(&file, content).expect("written");
        let output = ser_cli()
            .args(["sim", "--tcp", "127.0.0.1:0", "--contacts"])
            .arg(&file)
            .output()
            .expect("ser-cli runs");
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(
            error.contains("trip.csv") && error.contains(&format!("line {line}")),
            "{content}: {error}"
        );
    }
}

#[test]
fn each_way_of_not_being_there_has_its_own_message() {
    let bench = Bench::start(Kind::Native, &[]);
    let fails = |arguments: &[&str]| {
        let output = ser_cli().args(arguments).output().expect("ser-cli runs");
        let error = text(&output.stderr);
        assert!(error.starts_with("error: ") && error.contains("hint: "), "{error}");
        (output.status.code(), error.lines().next().map(str::to_owned))
    };
    let link = bench.link();
    let link = link.to_str().expect("UTF-8");
    let silent = tempfile::tempdir().expect("a folder");
    let file = silent.path().join("file");
    fs::write(&file, "").expect("written");
    let messages = [
        fails(&["status"]),
        fails(&["--port", "/dev/there-is-no-such-port", "status"]),
        fails(&["--port", file.to_str().expect("UTF-8"), "status"]),
        fails(&["--port", "tcp://127.0.0.1:1", "status"]),
        wrong_rate(link),
        silent_unit(&bench),
    ];
    let codes: Vec<_> = messages.iter().map(|(code, _)| *code).collect();
    assert_eq!(codes, [Some(2), Some(1), Some(1), Some(1), Some(1), Some(1)]);
    for (index, message) in messages.iter().enumerate() {
        assert!(!messages[..index].contains(message), "{message:?} stands for two things");
    }
}

type Ended = (Option<i32>, Option<String>);

/// Exit code and first line of the output of a command with a short timeout, and all its output.
fn impatient(port: &str, rate: &str) -> (Ended, String) {
    let output = ser_cli()
        .args(["--port", port, "--baud", rate, "--timeout", "50ms", "--retries", "0", "status"])
        .output()
        .expect("ser-cli runs");
    let error = text(&output.stderr);
    let first = error.lines().find(|line| line.starts_with("error: ")).map(str::to_owned);
    ((output.status.code(), first), error)
}

fn wrong_rate(port: &str) -> Ended {
    let mut ended = (None, None);
    // The search is short, and the simulator may have to wait longer than that for the processor.
    wait_until("the recorder is found at its own rate", || {
        let (end, error) = impatient(port, "19200");
        assert!(error.contains("hint: "), "{error}");
        ended = end;
        error.contains("no answer at 19200 baud; the recorder answers at 9600")
            && error.contains("--baud 9600")
    });
    ended
}

fn silent_unit(bench: &Bench) -> Ended {
    bench.sim.signal("-STOP");
    let (ended, error) = impatient(bench.link().to_str().expect("UTF-8"), "9600");
    assert!(
        error.contains("not one byte") && error.contains("at any other rate either"),
        "{error}"
    );
    ended
}

#[test]
fn print_shows_what_was_asked_for_although_the_unit_prints_new_events_too() {
    let mut bench = Bench::start(Kind::Native, &["--paced"]);
    bench.contacts("0,1,1\n1,2,1\n2,3,1\n3,4,1\n4,5,1", 5);
    bench.ok("config --auto-print on");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    let steps: String =
        (0..500).map(|index| format!("{},32,{}\n", 20 * index, (index + 1) % 2)).collect();
    write!(input, "ms,input,state\n{steps}\n").expect("the simulator reads");
    wait_until("new events are printed", || bench.entries() > 8);
    let printed = bench.ok("print --from 1 --count 5");
    let starts: Vec<_> =
        printed.lines().map(|line| line.split(' ').next().unwrap_or_default()).collect();
    assert_eq!(starts, ["0001", "0002", "0003", "0004", "0005"], "{printed}");
}

#[test]
fn scenarios_on_standard_input_follow_each_other_until_a_line_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("unit");
    let mut sim = Running::start(
        ser_cli()
            .args(["sim", "--contacts", "-", "--pty"])
            .arg(&link)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped()),
    );
    wait_until("the link appears", || link.exists());
    let mut input = sim.0.stdin.take().expect("piped");
    input
        .write_all(b"ms,input,state\n0,1,1\n20,1,0\n\nms,input,state\n0,2,1\n7,2,0\n\n")
        .expect("read");
    let changes = || {
        let read = ser_cli()
            .args(["--timeout", "20s", "read", "--format", "csv", "--port"])
            .arg(&link)
            .output();
        let csv = text(&read.expect("ser-cli runs").stdout);
        csv.lines()
            .skip(1)
            .map(|row| row.split(',').skip(2).take(2).collect::<Vec<_>>().join(" "))
            .collect::<Vec<_>>()
    };
    wait_until("both scenarios are over", || changes().len() >= 4);
    assert_eq!(changes(), ["1 1", "1 0", "2 1", "2 0"]);
    input.write_all(b"ms,input,state\nsoon,3,1\n").expect("read");
    assert_eq!(sim.wait(), Some(1));
    let mut error = String::new();
    sim.0.stderr.take().expect("piped").read_to_string(&mut error).expect("text");
    assert!(
        error.contains("standard input") && error.contains("line 10") && error.contains("hint: "),
        "{error}"
    );
    assert!(fs::symlink_metadata(&link).is_err(), "the link goes with the simulator");
}

#[test]
fn what_the_simulator_lacks_is_named_with_a_hint_that_fits() {
    for (arguments, code, said) in [
        (["--contacts", "/no/trip.csv"], 1, ["/no/trip.csv", "--contacts names a CSV file"]),
        (["--image", "/no/image.elf"], 1, ["/no/image.elf", "cargo xtask firmware"]),
        (["--tcp", "nowhere"], 2, ["HOST:PORT", "127.0.0.1:4000"]),
        (["--tcp", "192.0.2.1:0"], 1, ["192.0.2.1:0", "this computer"]),
    ] {
        let output = ser_cli().arg("sim").args(arguments).output().expect("ser-cli runs");
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{error}");
        assert!(said.iter().all(|words| error.contains(words)), "{error}");
    }
}

#[test]
fn a_second_reader_of_what_is_new_is_told_of_the_first() {
    let bench = Bench::start(Kind::Native, &[]);
    let mut watch = Running::start(
        bench.command("watch --format csv").stdout(Stdio::piped()).stderr(Stdio::null()),
    );
    watch.lines().recv_timeout(PATIENCE).expect("watch has the state");
    let error = bench.fails(1, "read --new");
    assert!(error.contains("another ser-cli") && error.contains("hint: "), "{error}");
}

#[test]
fn a_unit_is_the_same_however_its_port_is_spelled() {
    let mut bench = Bench::start(Kind::Native, &[]);
    fs::create_dir(bench.folder.path().join("sub")).expect("a folder");
    bench.contacts("0,1,1", 1);
    let read = |port: &Path| {
        let output = bench.command("read --new --format jsonl").arg("--port").arg(port).output();
        let output = output.expect("ser-cli runs");
        assert!(output.status.success(), "{}", text(&output.stderr));
        events(&text(&output.stdout)).len()
    };
    assert_eq!(read(&bench.link()), 1);
    for spelled in ["sub/../unit", "./unit"] {
        assert_eq!(read(&bench.folder.path().join(spelled)), 0, "{spelled}");
    }
    // Two files, each with its lock: what was delivered, and what is kept for a report.
    assert_eq!(fs::read_dir(bench.folder.path().join("state")).expect("a folder").count(), 4);
    // A name that no file can have changes nothing.
    let deep = bench.folder.path().join(format!("{}sub/../unit", "./".repeat(200)));
    assert_eq!(read(&deep), 0);
    let long = bench.folder.path().join("n".repeat(240));
    std::os::unix::fs::symlink(bench.link(), &long).expect("a link");
    assert_eq!([read(&long), read(&long)], [0, 0]);
}

#[test]
fn a_polite_kill_lets_watch_put_the_configuration_back() {
    let bench = Bench::start(Kind::Native, &[]);
    let before = bench.ok("config");
    let mut watch = Running::start(
        bench.command("watch --format csv").stdout(Stdio::piped()).stderr(Stdio::null()),
    );
    watch.lines().recv_timeout(PATIENCE).expect("watch has the unit");
    watch.signal("-TERM");
    assert_eq!(watch.wait(), Some(0));
    assert_eq!(bench.ok("config"), before);
}

#[test]
fn two_signals_in_one_moment_are_one_wish() {
    let bench = Bench::start(Kind::Native, &[]);
    let before = bench.ok("config");
    for signals in ["INT TERM", "HUP HUP HUP", "TERM TERM"] {
        let mut watch = Running::start(
            bench.command("watch --format csv").stdout(Stdio::piped()).stderr(Stdio::null()),
        );
        let lines = watch.lines();
        lines.recv_timeout(PATIENCE).expect("watch has the recorder");
        // One shell sends them all, so that they come within milliseconds.
        let pid = watch.0.id();
        let all: Vec<_> = signals.split(' ').map(|name| format!("kill -{name} {pid}")).collect();
        let mut shell = Command::new("sh");
        // A signal that comes too late finds no process.
        let _ = shell.arg("-c").arg(all.join("; ")).stderr(Stdio::null()).status();
        assert_eq!(watch.wait(), Some(0), "{signals}");
        assert_eq!(bench.ok("config"), before, "{signals}");
    }
}

#[test]
fn a_hang_up_that_is_to_be_ignored_is() {
    let mut bench = Bench::start(Kind::Native, &[]);
    let mut shell = Command::new("sh");
    let watch = "trap '' HUP; exec \"$0\" --timeout 20s watch --format csv";
    shell.args(["-c", watch, env!("CARGO_BIN_EXE_ser-cli")]);
    shell.env("SER_PORT", bench.link()).env("SER_STATE_DIR", bench.folder.path().join("state"));
    let mut watch = Running::start(shell.stdout(Stdio::piped()).stderr(Stdio::null()));
    let lines = watch.lines();
    lines.recv_timeout(PATIENCE).expect("watch has the recorder");
    watch.signal("-HUP");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    write!(input, "ms,input,state\n0,7,1\n\n").expect("the simulator reads");
    let row = lines.recv_timeout(PATIENCE).expect("it goes on");
    assert!(row.contains(",7,1,"), "{row}");
    assert_eq!(watch.interrupt(), Some(0));
}

#[test]
fn the_second_interrupt_ends_a_command_that_waits_for_a_silent_unit() {
    let bench = Bench::start(Kind::Native, &[]);
    let mut watch = Running::start(
        bench
            .command("watch --format csv --interval 10ms")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped()),
    );
    watch.lines().recv_timeout(PATIENCE).expect("watch has the unit");
    bench.sim.signal("-STOP");
    let began = Instant::now();
    wait_until("watch ends", || {
        // However far apart the signals are, and whether the first comes during a question or
        // before it.
        watch.signal("-INT");
        watch.0.try_wait().expect("a child").is_some()
    });
    assert_eq!(watch.wait(), Some(1));
    // The recorder would have had three attempts of 20 s.
    assert!(began.elapsed() < Duration::from_secs(55), "it has waited for the unit");
    let mut error = String::new();
    watch.0.stderr.take().expect("piped").read_to_string(&mut error).expect("text");
    assert!(error.contains("hint: the recorder may still report automatically"), "{error}");
}

#[test]
fn a_reading_that_is_interrupted_fails_and_the_next_goes_on_there() {
    let mut bench = Bench::start(Kind::Native, &["--paced"]);
    let steps: Vec<_> = (0..300).map(|index| format!("{index},5,{}", (index + 1) % 2)).collect();
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    write!(input, "ms,input,state\n{}\n\n", steps.join("\n")).expect("the simulator reads");
    wait_until("all have moved", || bench.ok("status").contains("300 since"));
    let mut read = Running::start(
        bench.command("read --new --format jsonl").stdout(Stdio::piped()).stderr(Stdio::piped()),
    );
    let lines = read.lines();
    let first = lines.recv_timeout(PATIENCE).expect("a line");
    assert_eq!(read.interrupt(), Some(1));
    let lines: Vec<String> = std::iter::once(first).chain(lines).collect();
    let mut all = events(&lines.join("\n"));
    assert!(all.len() < 300, "it was too fast to be interrupted");
    all.extend(events(&bench.ok("read --new --format jsonl")));
    let numbers: Vec<_> = all.iter().filter_map(|line| line.split(',').next()).collect();
    let expected: Vec<_> = (1..=300).map(|number| format!("{{\"entry\":{number}")).collect();
    assert_eq!(numbers, expected);
}

#[test]
fn a_port_that_somebody_else_has_is_busy() {
    let bench = Bench::start(Kind::Native, &[]);
    let mut watch = Running::start(
        bench.command("watch --format csv").stdout(Stdio::piped()).stderr(Stdio::null()),
    );
    let lines = watch.lines();
    lines.recv_timeout(PATIENCE).expect("watch has the port");
    let error = bench.fails(1, "status");
    assert!(error.contains("in use") && error.contains("hint: "), "{error}");
}

#[test]
fn what_encode_writes_decode_reads() {
    let output = ser_cli()
        .args(["encode", "read", "--from", "500", "--count", "5"])
        .output()
        .expect("it runs");
    let frame = text(&output.stdout);
    assert_eq!(frame.trim_end(), "1B 30 34 35 32 30 31 46 34 30 35 34 43");
    let mut decode = Running::start(
        ser_cli().arg("decode").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()),
    );
    let mut input = decode.0.stdin.take().expect("piped");
    input.write_all(frame.as_bytes()).expect("decode reads");
    drop(input);
    let mut decoded = String::new();
    decode.0.stdout.take().expect("piped").read_to_string(&mut decoded).expect("text");
    assert_eq!(
        decoded.split_whitespace().skip(1).collect::<Vec<_>>().join(" "),
        "host read 5 entries from entry 500"
    );
}

#[test]
fn a_damaged_capture_is_decoded_with_the_damage_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let capture = folder.path().join("capture.bin");
    fs::write(&capture, b"\x1B014546hello\r\n\x1B0145\x1B014545").expect("written");
    let output = ser_cli().arg("decode").arg(&capture).output().expect("ser-cli runs");
    let lines = text(&output.stdout);
    let starts: Vec<Vec<&str>> =
        lines.lines().map(|line| line.split_whitespace().take(2).collect()).collect();
    assert_eq!(
        starts,
        [vec!["0", "damage"], vec!["7", "text"], vec!["14", "damage"], vec!["19", "either"]],
        "{lines}"
    );
}

#[test]
fn the_demo_tells_the_whole_story() {
    let shown = demo(&[]);
    assert!(shown.contains("the same contact on both\n"), "{shown}");
}

#[test]
#[ignore = "needs the emulator and the image: cargo xtask test"]
fn the_demo_does_the_same_with_the_image() {
    demo(&["--image", image().to_str().expect("UTF-8")]);
}

/// Runs the demo, and looks for everything that it promises to show.
fn demo(options: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let (home, temporary) = (folder.path().join("home"), folder.path().join("tmp"));
    for path in [&home, &temporary] {
        fs::create_dir(path).expect("a folder");
    }
    let mut demo = ser_cli();
    demo.arg("demo").args(options);
    let homes = ["HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME"];
    demo.envs(homes.map(|name| (name, &home))).env("TMPDIR", &temporary);
    let output = demo.output().expect("ser-cli runs");
    let shown = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for told in [
        "first-out  51 phase A PICKUP (SER1), ",
        "SER2: 1 entry missing (overwritten)",
        "  SER2      1 entry missing (overwritten)\n",
        "chatter ×15, last +144.0 ms\n",
        "same_as = \"SER2/52-1 closed\"\n",
        "Not normal at the end\n52-1 closed OPEN\n",
    ] {
        assert!(shown.contains(told), "{told}: {shown}");
    }
    // Each end is seen in a millisecond, so what passes between them may show one more or less.
    for (told, took_ms) in [
        ("operated   52-1 opened ", 70.9),
        ("\nwrong      52-1 opens: late (", 70.9),
        ("\nlate    52-1 opens  ", 70.9),
        ("52-1: 52a and 52b both off for ", 9.1),
    ] {
        let shows = |ms: f64| shown.contains(&format!("{told}{ms:.1} ms"));
        assert!(
            [took_ms - 1.0, took_ms, took_ms + 1.0].map(shows).contains(&true),
            "{told}: {shown}"
        );
    }
    for recorder in ["SER1", "SER2"] {
        let opened = format!("  {recorder}      52-1 closed  OPEN  ");
        assert_eq!(shown.matches(&opened).count(), 1, "{recorder}: {shown}");
    }
    // Every contact of both is there: 8 entries of one, 20 of the other.
    assert!(shown.contains("\n28 entries, sha256 "), "{shown}");
    assert!(shown.lines().all(|line| line.chars().count() <= 100), "{shown}");
    for path in [home, temporary] {
        assert_eq!(fs::read_dir(&path).expect("a folder").count(), 0, "{}", path.display());
    }
    shown
}

#[test]
fn every_command_explains_itself_with_an_example() {
    let help = text(&ser_cli().arg("--help").output().expect("ser-cli runs").stdout);
    let commands: Vec<_> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(commands.len() >= 15, "{commands:?}");
    for command in commands {
        let help =
            text(&ser_cli().args([command, "--help"]).output().expect("ser-cli runs").stdout);
        let (_, examples) = help.split_once("Examples:\n").expect("examples");
        let example =
            |line: &str| line.contains("ser-cli ") && line.contains(&format!(" {command}"));
        assert!(examples.lines().any(example), "{help}");
    }
}

#[test]
fn output_that_nobody_reads_is_no_failure() {
    let mut demo =
        Running::start(ser_cli().arg("demo").stdout(Stdio::piped()).stderr(Stdio::piped()));
    drop(demo.0.stdout.take());
    let code = demo.wait();
    let mut error = String::new();
    demo.0.stderr.take().expect("piped").read_to_string(&mut error).expect("text");
    assert_eq!((code, error), (Some(0), String::new()));
}

#[test]
fn completions_know_the_subcommands() {
    for shell in ["bash", "zsh", "fish"] {
        let script =
            text(&ser_cli().args(["completions", shell]).output().expect("ser-cli runs").stdout);
        assert!(script.contains("last-broadcast"), "{shell}");
    }
}

#[test]
fn a_folder_is_no_capture() {
    let output = ser_cli().arg("decode").arg(Path::new("/")).output().expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("hint: "), "{}", text(&output.stderr));
}

/// A database reads the output in the way a user would load it.
mod needs_sqlite3 {
    use super::*;

    /// The answer of `SQLite` to a question about the table that a CSV file makes.
    fn asked(csv: &Path, question: &str) -> String {
        let import = format!(".import --csv '{}' events", csv.display());
        let output = Command::new("sqlite3").args([":memory:", &import, question]).output();
        let output = output.expect("sqlite3 runs: cargo xtask test --all installs it");
        assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
        text(&output.stdout)
    }

    #[test]
    #[ignore = "needs sqlite3: cargo xtask test"]
    fn a_log_in_csv_is_imported_with_every_event_and_its_columns() {
        let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
        bench.contacts("0,1,1\n0,16,1\n7,1,0\n9,16,0", 3);
        let csv = bench.folder.path().join("events.csv");
        fs::write(&csv, bench.ok("read --all --format csv")).expect("written");
        assert_eq!(
            asked(&csv, "select entry, input, state from events order by entry + 0, input + 0"),
            "1|1|1\n1|16|1\n2|1|0\n3|16|0\n"
        );
        // Both stamps are also times to `SQLite`, and as far apart as the contacts moved.
        let apart =
            "select round((max(julianday(time)) - min(julianday(time))) * 86400000) from events";
        assert_eq!(asked(&csv, apart), "9.0\n");
    }
}
