//! Losses are reported in the file, and in the exit code where that is requested.
#![cfg(unix)]

mod common;

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use common::bench::{Bench, text};
use common::{events, ser_cli};
use ser_proto::{
    Configuration, Decoded, Entry, FrameDecoder, FrameEncoder, Inputs, MAX_BODY_LEN, Model,
    ReadReply, Reply, TimeStamp,
};
use ser_sim::testing::Kind;

/// Six columns and a note.
fn columns(row: &str) -> Vec<&str> {
    row.splitn(7, ',').collect()
}

/// A recorder of 8 entries whose first three events have been read, and which has recorded twenty
/// more since.
fn overrun() -> Bench {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.ok("config --size 8");
    bench.contacts("0,1,1\n1,2,1\n2,3,1", 3);
    assert_eq!(bench.ok("read --new --format csv --fail-on-loss").lines().count(), 1 + 3);
    let steps: Vec<_> = (0..20).map(|index| format!("{index},5,{}", (index + 1) % 2)).collect();
    bench.contacts(&steps.join("\n"), 5);
    common::wait_until("all have moved", || bench.ok("status").contains("23 since"));
    bench
}

/// A recorder whose inputs can be seen whether or not they are recorded, because it is on a Genius
/// bus, too.
struct Seen {
    bench: Bench,
    window: tempfile::TempDir,
}

impl Seen {
    fn start() -> Seen {
        let window = tempfile::tempdir().expect("a folder");
        let host = window.path().join("host").display().to_string();
        let bench =
            Bench::start(Kind::Native, &["--model", "ser160", "--node", "5", "--genius", &host]);
        Seen { bench, window }
    }

    /// Moves contacts while recording is stopped, until these inputs are on.
    fn contacts(&mut self, lines: &str, on: &str) {
        let input = self.bench.sim.0.stdin.as_mut().expect("piped");
        write!(input, "ms,input,state\n{lines}\n\n").expect("the simulator reads");
        let port = format!("geni:{}", self.window.path().join("host").display());
        common::wait_until("the contacts have moved", || {
            let mut command = ser_cli();
            let globals =
                command.args(["genius", "globals", "--timeout", "20s", "--port", &port]).output();
            text(&globals.expect("ser-cli runs").stdout).lines().any(|line| line.ends_with(on))
        });
    }
}

/// Runs a command with its standard output appended to a file, as `>>` does.
fn append(bench: &Bench, arguments: &str, file: &Path) -> Output {
    let file = fs::File::options().append(true).create(true).open(file).expect("a file");
    bench.command(arguments).stdout(file).output().expect("ser-cli runs")
}

#[test]
fn a_loss_is_in_the_table_too_and_in_the_exit_code_if_that_is_wanted() {
    let bench = overrun();
    let output = bench.run("read --new --fail-on-loss");
    let (table, told) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert_eq!(table.lines().count(), 1 + 1 + 8, "everything that is there was delivered: {table}");
    let loss = "12 events were overwritten before they were read";
    assert!(table.lines().nth(1).is_some_and(|line| line.ends_with(loss)), "{table}");
    assert!(told.contains(loss) && told.contains("error: the output has a gap"), "{told}");
    // The loss has been reported. What comes now is complete.
    assert_eq!(bench.run("read --new --fail-on-loss").status.code(), Some(0));
}

#[test]
fn the_rows_of_a_log_and_its_losses_go_on_from_run_to_run() {
    let mut bench = overrun();
    let file = bench.folder.path().join("events.csv");
    assert_eq!(append(&bench, "read --new --format csv", &file).status.code(), Some(0));
    // Erased by somebody who does not know what was read here.
    bench.ok(&format!("erase --yes --state-dir {}", bench.folder.path().join("another").display()));
    bench.contacts("0,1,0", 1);
    assert_eq!(
        append(&bench, "read --new --format csv --fail-on-loss", &file).status.code(),
        Some(3)
    );

    let csv = fs::read_to_string(&file).expect("text");
    let rows: Vec<_> = csv.lines().map(columns).collect();
    assert_eq!(rows[0].join(","), "entry,time,input,state,sequence,life,note");
    assert_eq!(csv.matches("entry,time").count(), 1, "one header: {csv}");
    let (old, new) = (rows[1][5], rows[11][5]);
    assert_eq!(rows[1], ["", "", "", "", "3", old, "lost 12 (exactly) after 3: overwritten"]);
    let sequences: Vec<_> = rows[2..10].iter().map(|row| (row[4], row[5])).collect();
    let expected: Vec<_> = (16..=23).map(|sequence| sequence.to_string()).collect();
    assert_eq!(sequences, expected.iter().map(|sequence| (&sequence[..], old)).collect::<Vec<_>>());
    assert_eq!(
        rows[10],
        ["", "", "", "", "23", old, "lost an unknown number after 23: log began anew"]
    );
    assert_eq!((rows[11][0], rows[11][4]), ("1", "1"), "the new log counts from its beginning");
    assert!(old.len() == 16 && new.len() == 16 && old != new, "each log has its name: {csv}");
}

#[test]
fn inputs_that_change_while_recording_is_stopped_are_named() {
    let mut seen = Seen::start();
    seen.bench.contacts("0,1,1", 1);
    seen.bench.ok("stop");
    seen.contacts("0,7,1\n1,9,1", "  1 7 9");
    let bench = &mut seen.bench;
    bench.ok("start");
    bench.contacts("0,1,0", 1);
    let output = bench.run("read --format jsonl --fail-on-loss");
    let lines = events(&text(&output.stdout));
    let loss = "{\"lost\":null,\"count\":\"unknown\",\"after\":1,\"why\":\"not \
     recorded\",\"inputs\":[7,9],\"life\":\"0\"}";
    assert_eq!((lines.len(), output.status.code()), (3, Some(3)));
    assert_eq!(lines[1], loss);
    assert!(
        text(&output.stderr)
            .contains("lost ahead of entry 2: inputs 7 9 changed while nothing was recorded")
    );
    // Also when read by number.
    let range = bench.run("read --from 1 --count 2 --format csv --fail-on-loss");
    assert!(
        text(&range.stdout).contains(",,,,,0,\"lost an unknown number: not recorded, inputs 7 9\"")
    );
    assert_eq!(range.status.code(), Some(3));
}

/// Runs `ser-cli` as a shell starts it with this script, in which `"$@"` stands for the command.
fn in_shell(bench: &Bench, arguments: &str, script: &str) -> Output {
    let ser_cli = bench.command(arguments);
    let mut shell = Command::new("sh");
    shell.args(["-c", script, "sh"]).arg(ser_cli.get_program()).args(ser_cli.get_args());
    for (name, value) in ser_cli.get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    shell.output().expect("sh runs")
}

/// With a limit to the size of files, in blocks of 512 or of 1024 bytes: equivalent to a full disk.
fn limited(bench: &Bench, arguments: &str, file: &Path, blocks: u32) -> Output {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\" >> '{}'", file.display());
    in_shell(bench, arguments, &script)
}

#[test]
fn a_file_that_is_full_ends_with_a_whole_row_and_the_next_run_goes_on_there() {
    let mut bench = Bench::start(Kind::Native, &[]);
    let steps: Vec<_> = (0..60).map(|index| format!("{index},5,{}", (index + 1) % 2)).collect();
    bench.contacts(&steps.join("\n"), 60);
    let file = bench.folder.path().join("events.csv");
    // Sixty rows of 54 bytes: three blocks of 512, or of 1024, are not enough.
    let output = limited(&bench, "read --new --format csv", &file, 3);
    assert_eq!(output.status.code(), Some(1));
    let told = text(&output.stderr);
    assert!(told.contains("cannot write standard output") && told.contains("hint: "), "{told}");
    let csv = fs::read_to_string(&file).expect("text");
    assert!(csv.len() > 500 && csv.ends_with('\n'), "{csv}");

    assert_eq!(append(&bench, "read --new --format csv", &file).status.code(), Some(0));
    let csv = fs::read_to_string(&file).expect("text");
    let sequences: Vec<_> = csv.lines().skip(1).map(|row| columns(row)[4].to_owned()).collect();
    assert_eq!(sequences, (1..=60).map(|sequence| sequence.to_string()).collect::<Vec<_>>());
}

#[test]
fn a_file_that_ends_in_a_row_gets_a_line_end_first() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.contacts("0,5,1", 1);
    let file = bench.folder.path().join("events.csv");
    fs::write(&file, "entry,time,input,state,sequence,life,note\n1,2026-11-2").expect("written");
    assert_eq!(append(&bench, "read --format csv", &file).status.code(), Some(0));
    let csv = fs::read_to_string(&file).expect("text");
    let rows: Vec<_> = csv.lines().collect();
    assert_eq!((rows.len(), rows[1]), (3, "1,2026-11-2"), "{csv}");
    assert!(rows[2].starts_with("1,") && rows[2].ends_with(",5,1,1,0,"), "{csv}");
}

/// A recorder on TCP whose log holds these entries; returns its port.
fn unit_with(entries: Vec<Entry>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = format!("tcp://{}", listener.local_addr().expect("an address"));
    thread::spawn(move || {
        while let Ok((client, _)) = listener.accept() {
            answer(client, &entries);
        }
    });
    port
}

/// Answers requests until the client goes.
fn answer(mut client: TcpStream, entries: &[Entry]) {
    let mut decoder = FrameDecoder::<MAX_BODY_LEN>::new();
    let mut bytes = [0; 256];
    while let Ok(count @ 1..) = client.read(&mut bytes) {
        for &byte in &bytes[..count] {
            let Some(Decoded::Frame(body)) = decoder.push(byte) else { continue };
            let reply = match *body {
                [b'C'] => Reply::Configuration(Configuration::default()),
                [b'R', high, low, count] => {
                    Reply::Read(read(entries, u16::from_be_bytes([high, low]), count))
                }
                _ => continue,
            };
            let frame: Vec<u8> = FrameEncoder::new(reply.to_body()).collect();
            client.write_all(&frame).expect("the client reads");
        }
    }
}

fn read(entries: &[Entry], start: u16, count: u8) -> ReadReply {
    let held = u16::try_from(entries.len()).expect("a few");
    let asked_for = entries.iter().skip(usize::from(start) - 1).take(count.into()).copied();
    let entries: heapless::Vec<Entry, 10> = asked_for.collect();
    let model = (!entries.is_empty()).then_some(Model::Ser160);
    ReadReply { start, total: held, next_slot: held, model, entries }
}

#[test]
fn entries_that_cannot_be_are_delivered_and_marked_and_harm_no_others() {
    let time =
        TimeStamp { year: 26, month: 11, day: 22, hour: 10, minute: 0, second: 0, millisecond: 7 };
    let at =
        |time: TimeStamp, on: bool| Entry { changed: Inputs(1), state: Inputs(on.into()), time };
    let mut entries = vec![
        at(time, true),
        at(TimeStamp { month: 13, ..time }, false),
        at(TimeStamp { millisecond: 1000, ..time }, true),
        Entry { changed: Inputs(0), state: Inputs(1), time },
        at(TimeStamp { day: 31, ..time }, false),
        at(TimeStamp { year: 200, ..time }, true),
    ];
    entries.push(at(TimeStamp { millisecond: 8, ..time }, false));
    let port = unit_with(entries);
    let read = |format: &str| {
        let mut command = ser_cli();
        command.args(["read", "--format", format, "--timeout", "20s", "--port", &port]);
        command.output().expect("ser-cli runs")
    };
    let csv = read("csv");
    assert_eq!(csv.status.code(), Some(0), "{}", text(&csv.stderr));
    assert_eq!(
        text(&csv.stdout).lines().skip(1).collect::<Vec<_>>(),
        [
            "1,2026-11-22T10:00:00.007,1,1,1,0,",
            "2,2026-13-22T10:00:00.007,1,0,2,0,month 13 is out of range",
            "3,2026-11-22T10:00:00.1000,1,1,3,0,millisecond 1000 is out of range",
            "4,2026-11-22T10:00:00.007,,,4,0,\"no input changed, on: 1\"",
            "5,2026-11-31T10:00:00.007,1,0,5,0,day 31 is out of range",
            "6,2100-11-22T10:00:00.007,1,1,6,0,year 200 is out of range",
            "7,2026-11-22T10:00:00.008,1,0,7,0,",
        ]
    );
    let told = text(&csv.stderr);
    let warnings: Vec<_> = told.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert_eq!(warnings.len(), 4, "{told}");
    assert!(warnings[0].contains("entry 2") && warnings[3].contains("2 more entries"), "{told}");

    let jsonl = text(&read("jsonl").stdout);
    assert_eq!((events(&jsonl).len(), jsonl.matches("\"note\":").count()), (7, 5), "{jsonl}");
    let table = text(&read("table").stdout);
    let marked = table.lines().filter(|line| line.ends_with(')')).count();
    assert_eq!((table.lines().count(), marked), (1 + 7, 5), "{table}");
}

#[test]
fn reading_and_erasing_again_and_again_loses_nothing_and_says_so() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    let file = bench.folder.path().join("events.csv");
    for round in 0..4 {
        bench.contacts(&format!("0,1,{}\n1,2,{}", (round + 1) % 2, (round + 1) % 2), 2);
        let read = append(&bench, "read --new --format csv --fail-on-loss", &file);
        assert_eq!(read.status.code(), Some(0), "round {round}: {}", text(&read.stderr));
        let erased = bench.run("erase --yes");
        assert!(!text(&erased.stderr).contains("warning"), "{}", text(&erased.stderr));
    }
    let csv = fs::read_to_string(&file).expect("text");
    let lives: std::collections::BTreeSet<_> =
        csv.lines().skip(1).map(|row| columns(row)[5]).collect();
    assert_eq!((csv.lines().count(), lives.len()), (1 + 8, 4), "{csv}");
    assert_eq!(
        columns(csv.lines().last().expect("a row"))[4],
        "2",
        "each log counts from its beginning"
    );
}

#[test]
fn what_an_erase_takes_along_unread_is_told() {
    let mut seen = Seen::start();
    let bench = &mut seen.bench;
    bench.contacts("0,1,1", 1);
    bench.ok("read --new --format csv");
    bench.contacts("0,2,1\n1,2,0", 2);
    let erased = text(&bench.run("erase --yes").stderr);
    assert!(erased.contains("warning: 2 events have not been delivered"), "{erased}");
    bench.contacts("0,1,0", 1);
    let output = bench.run("read --new --format csv --fail-on-loss");
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stdout).contains("lost an unknown number after 1: log began anew"));

    // A change without an event in the new log is also lost, such as one between the last look and
    // the erase.
    bench.ok("stop");
    seen.contacts("0,7,1", "  7");
    let bench = &mut seen.bench;
    bench.ok("erase --yes");
    bench.ok("start");
    bench.contacts("0,1,1", 1);
    let output = bench.run("read --new --format csv --fail-on-loss");
    assert_eq!(output.status.code(), Some(3));
    let stdout = text(&output.stdout);
    assert!(
        stdout.contains("\"lost an unknown number after 0: not recorded, inputs 7\""),
        "{stdout}"
    );
}

#[test]
fn what_cannot_be_written_is_not_delivered() {
    let mut bench = Bench::start(Kind::Native, &[]);
    bench.contacts("0,1,1", 1);
    for (standard_output, why) in
        [("1</dev/null", "cannot write"), (">&-", "closed"), (">/dev/full", "space")]
    {
        let script = format!("exec \"$@\" {standard_output}");
        let output = in_shell(&bench, "read --new --format csv", &script);
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{standard_output}: {told}");
        assert!(told.contains(why), "{standard_output}: {told}");
    }
    assert_eq!(bench.ok("read --new --format csv").lines().count(), 2, "it is still to come");
}

#[test]
fn a_step_of_the_clock_is_noted_from_run_to_run_and_not_where_the_ring_goes_around() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.ok("config --size 8");
    let steps: Vec<_> = (0..11).map(|index| format!("{index},5,{}", (index + 1) % 2)).collect();
    bench.contacts(&steps.join("\n"), 8);
    let by_number = bench.ok("read --from 1 --count 8 --format csv");
    assert!(!by_number.contains("went back"), "entry 4 is the oldest: {by_number}");
    bench.ok("read --new --format csv");
    bench.ok("clock set --at 2020-01-01T00:00:00");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    write!(input, "ms,input,state\n0,5,0\n\n").expect("the simulator reads");
    common::wait_until("it has moved", || bench.ok("status").contains("12 since"));
    let new = bench.ok("read --new --format csv");
    assert!(new.trim_end().ends_with("the clock went back"), "{new}");
}

#[test]
fn a_unit_that_is_called_by_a_link_and_by_its_device_in_turn_delivers_each_event_once() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    let link = bench.folder.path().join("another");
    std::os::unix::fs::symlink(bench.link(), &link).expect("a link");
    let names = [bench.link(), link];
    for (round, name) in (0..6).zip(names.iter().cycle()) {
        bench.contacts(&format!("0,1,{}", (round + 1) % 2), 1);
        let read = bench
            .command("read --new --format csv --fail-on-loss")
            .arg("--port")
            .arg(name)
            .output();
        let read = read.expect("ser-cli runs");
        assert_eq!(read.status.code(), Some(0), "round {round}: {}", text(&read.stderr));
        let rows = text(&read.stdout);
        assert_eq!(
            rows.lines().skip(1).map(|row| columns(row)[4]).collect::<Vec<_>>(),
            [(round + 1).to_string()]
        );
    }
}

#[test]
fn nothing_is_erased_where_it_cannot_be_said_whether_it_was_delivered() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.contacts("0,1,1", 1);
    bench.ok("read --new --format csv");
    let state = bench.folder.path().join("state");
    let file = fs::read_dir(&state).expect("a folder").map(|file| file.expect("a file").path());
    let file = file.into_iter().find(|file| file.extension().is_some_and(|end| end == "json"));
    fs::write(file.expect("the state"), "{").expect("written");
    let told = bench.fails(1, "erase --yes");
    assert!(told.contains("does not say what was delivered") && told.contains("hint: "), "{told}");
    assert_eq!(bench.entries(), 1);
}
