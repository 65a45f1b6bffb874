//! `collect`, as a user and as a service manager see it.
#![cfg(all(unix, feature = "archive"))]

mod common;

use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::bench::text;
use common::{Running, ser_cli, wait_until};
use rusqlite::Connection;
use ser_proto::Model;
use ser_sim::testing::PATIENCE;
use ser_sim::{Port, Scenario, SimOptions, Simulator, Step};
use tempfile::TempDir;

/// A plant: recorders on TCP, their site file, and an archive.
struct Plant {
    folder: TempDir,
    recorders: Vec<Simulator>,
}

impl Plant {
    fn start(count: usize) -> Plant {
        let start = |_| {
            let options = SimOptions::new(Model::Ser160, Port::tcp("127.0.0.1:0"));
            Simulator::start(options).unwrap()
        };
        let recorders: Vec<Simulator> = (0..count).map(start).collect();
        let plant = Plant { folder: tempfile::tempdir().unwrap(), recorders };
        let ports: Vec<String> =
            plant.recorders.iter().map(|recorder| recorder.port().to_owned()).collect();
        plant.write_site(&ports);
        plant
    }

    /// Recorders U1, U2 … at these ports.
    fn write_site(&self, ports: &[String]) {
        let recorders = ports.iter().zip(1..).map(|(port, number)| {
            format!("[[recorder]]\nname = \"U{number}\"\nport = \"{port}\"\n")
        });
        let site = format!("site = \"N\"\ntime_zone = \"UTC\"\n{}", recorders.collect::<String>());
        fs::write(self.site(), site).unwrap();
    }

    fn site(&self) -> PathBuf {
        self.folder.path().join("plant.toml")
    }

    fn archive(&self) -> PathBuf {
        self.folder.path().join("plant.db")
    }

    fn collect(&self, options: &str) -> Command {
        let mut command = ser_cli();
        command.env("SER_STATE_DIR", self.folder.path().join("state"));
        command.args(["--timeout", "20s", "collect"]).args(options.split_whitespace());
        command.arg("--site").arg(self.site());
        command
    }

    fn run(&self, options: &str) -> Output {
        self.collect(options).output().unwrap()
    }

    fn number(&self, query: &str) -> i64 {
        let archive = Connection::open(self.archive()).unwrap();
        archive.query_row(query, (), |row| row.get(0)).unwrap()
    }
}

/// Input 3 closes and opens so many times.
fn blink(recorder: &Simulator, times: u64) {
    let step = |at_ms| Step { at_ms: at_ms * 2, input: 3, on: at_ms % 2 == 0 };
    recorder.play(Scenario::from_steps((0..2 * times).map(step))).unwrap();
    recorder.wait_played(PATIENCE).unwrap();
}

#[test]
fn what_is_new_is_archived_once_and_a_table_says_what_came() {
    let plant = Plant::start(2);
    blink(&plant.recorders[0], 10);
    let first = plant.run("--once");
    assert_eq!(first.status.code(), Some(0), "{}", text(&first.stderr));
    assert_eq!(
        text(&first.stdout),
        "recorder  new  state\nU1        20   read\nU2        0    read\n"
    );
    blink(&plant.recorders[1], 3);
    let second = text(&plant.run("--once --fail-on-loss").stdout);
    assert_eq!(second, "recorder  new  state\nU1        0    read\nU2        6    read\n");
    assert_eq!(plant.number("SELECT count(*) FROM entry"), 26);
}

#[test]
fn a_recorder_that_is_not_there_is_told_and_the_others_are_read() {
    let plant = Plant::start(1);
    blink(&plant.recorders[0], 1);
    let ports = [plant.recorders[0].port().to_owned(), "tcp://127.0.0.1:1".to_owned()];
    plant.write_site(&ports);
    let read = plant.run("--once");
    assert_eq!(read.status.code(), Some(1));
    let (table, told) = (text(&read.stdout), text(&read.stderr));
    assert!(table.contains("U1        2    read"), "{table}");
    assert!(table.contains("U2        0    not read: nothing listens"), "{table}");
    assert!(told.contains("error: not read: U2") && told.contains("hint: "), "{told}");

    let check = plant.run("--check");
    assert_eq!(check.status.code(), Some(1));
    let table = text(&check.stdout);
    assert!(table.contains("U1        yes, and says which log it has"), "{table}");
    assert!(table.contains("U2        no: nothing listens"), "{table}");
}

#[test]
fn exchanged_cables_are_told_and_nothing_is_filed_under_the_wrong_name() {
    let plant = Plant::start(2);
    blink(&plant.recorders[0], 5);
    assert_eq!(plant.run("--once").status.code(), Some(0));
    let mut ports: Vec<String> =
        plant.recorders.iter().map(|recorder| recorder.port().to_owned()).collect();
    ports.reverse();
    plant.write_site(&ports);
    blink(&plant.recorders[0], 5);
    let read = plant.run("--once");
    let told = text(&read.stderr);
    assert_eq!(read.status.code(), Some(1), "{told}");
    assert!(told.contains("the recorder at its port is U2"), "{told}");
    assert!(told.contains("--moved"), "{told}");
    assert_eq!(plant.number("SELECT count(*) FROM entry"), 10);
    // Each is moved on its own.
    let one = plant.run("--once --moved U1");
    assert_eq!(one.status.code(), Some(1));
    let table = text(&one.stdout);
    assert!(table.contains("U2        0") && table.contains("is U1"), "{table}");
    // On purpose, it is as good as any other.
    let moved = plant.run("--once --moved U1 --moved U2");
    assert_eq!(moved.status.code(), Some(0), "{}", text(&moved.stderr));
    assert_eq!(plant.number("SELECT count(DISTINCT life) FROM entry WHERE recorder = 2"), 1);
}

#[test]
fn two_recorders_that_were_never_met_before_are_told_apart_by_what_they_read() {
    let plant = Plant::start(2);
    blink(&plant.recorders[0], 2);
    blink(&plant.recorders[1], 4);
    assert_eq!(plant.run("--once").status.code(), Some(0));
    let of = |name: &str| {
        plant.number(&format!(
            "SELECT count(*) FROM entry JOIN recorder ON recorder.id = recorder WHERE name = '{name}'"
        ))
    };
    assert_eq!((of("U1"), of("U2")), (4, 8));
}

#[test]
fn a_recorder_that_was_erased_or_lost_its_power_has_another_life() {
    let plant = Plant::start(1);
    let recorder = &plant.recorders[0];
    blink(recorder, 2);
    assert_eq!(plant.run("--once").status.code(), Some(0));
    blink(recorder, 1);
    recorder.power_cycle().unwrap();
    blink(recorder, 3);
    let read = plant.run("--once --fail-on-loss");
    assert_eq!(read.status.code(), Some(3), "{}", text(&read.stderr));
    assert_eq!(plant.number("SELECT count(*) FROM entry"), 4 + 6);
    assert_eq!(plant.number("SELECT count(DISTINCT life) FROM entry"), 2);
    let told = "SELECT count(*) FROM evidence WHERE line LIKE '%log began anew%'";
    assert_eq!(plant.number(told), 1);
}

#[test]
fn mistakes_are_told_with_what_to_try() {
    let plant = Plant::start(1);
    for (options, code, told) in [
        ("--forward other.db", 2, "this is no database"),
        ("--moved U7", 2, "the site has no recorder U7"),
        ("--once --archive postgres://ser:secret@db/plant", 2, "~/.pgpass"),
        ("--once --archive /no/such/folder/plant.db", 1, "plant.db"),
        ("--check --archive /no/such/folder/plant.db", 1, "there is no folder"),
        ("--set-clocks noon", 2, "03:30"),
        #[cfg(not(feature = "postgres"))]
        ("--once --forward postgres://ser@db/plant", 2, "built without PostgreSQL"),
    ] {
        let output = plant.run(options);
        let (error, is_told) = (text(&output.stderr), output.status.code() == Some(code));
        assert!(is_told && error.contains(told), "{options}: {error}");
        assert!(code == 2 || error.contains("hint: "), "{options}: {error}");
        assert!(!error.contains("secret") || options.contains("secret"), "{error}");
    }
    fs::write(plant.archive(), "a letter").unwrap();
    let output = plant.run("--once");
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("is no archive") && text(&output.stderr).contains("hint: "),
        "{}",
        text(&output.stderr)
    );
    assert_eq!(fs::read(plant.archive()).unwrap(), b"a letter");
}

#[test]
fn what_was_done_with_the_command_line_is_archived_too() {
    let plant = Plant::start(1);
    let set_clock = |archive: Option<PathBuf>| {
        let mut command = ser_cli();
        command.env("SER_STATE_DIR", plant.folder.path().join("state"));
        command.envs(archive.map(|archive| ("SER_ARCHIVE", archive)));
        command.args(["--port", plant.recorders[0].port(), "clock", "set"]);
        command.output().unwrap()
    };
    let archived = || plant.number("SELECT count(*) FROM evidence WHERE kind = 'command'");
    // Without an archive it is in the state directory until somebody collects.
    assert_eq!(set_clock(None).status.code(), Some(0));
    for _ in 0..2 {
        assert_eq!(plant.run("--once").status.code(), Some(0));
        assert_eq!(archived(), 1);
    }
    let names = "SELECT count(*) FROM recorder";
    // With one it is there at once, also under the recorder's name, and with one that is not there it is told and kept.
    assert_eq!(set_clock(Some(plant.archive())).status.code(), Some(0));
    assert_eq!(archived(), 2);
    let elsewhere = set_clock(Some(plant.folder.path().join("nothing.db")));
    assert_eq!(elsewhere.status.code(), Some(0));
    let told = text(&elsewhere.stderr);
    assert!(told.contains("there is no archive") && told.contains("state directory"), "{told}");
    assert_eq!(plant.run("--once").status.code(), Some(0));
    assert_eq!(archived(), 3);
    assert!(!plant.folder.path().join("nothing.db").exists());
    assert_eq!(plant.number(names), 1);
    // All of them are listed, each once.
    let mut command = ser_cli();
    command.env("SER_STATE_DIR", plant.folder.path().join("state"));
    let audit = command.args(["audit", "--archive"]).arg(plant.archive()).output().unwrap();
    assert_eq!(text(&audit.stdout).matches("set clock to").count(), 3, "{}", text(&audit.stdout));
}

/// What the service says, word by word.
fn words(manager: &UnixDatagram) -> Vec<String> {
    let mut buffer = [0; 4096];
    let length = manager.recv(&mut buffer).unwrap();
    String::from_utf8_lossy(&buffer[..length]).lines().map(str::to_owned).collect()
}

fn manager(folder: &Path) -> (UnixDatagram, PathBuf) {
    let path = folder.join("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    manager.set_read_timeout(Some(PATIENCE)).unwrap();
    (manager, path)
}

#[test]
fn a_service_says_when_it_is_ready_and_alive_and_about_to_end() {
    let plant = Plant::start(1);
    let (manager, path) = manager(plant.folder.path());
    let mut command = plant.collect("--hasten 60");
    command.env("NOTIFY_SOCKET", path).env("WATCHDOG_USEC", "300000");
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut collector = Running::start(&mut command);
    let mut said = Vec::new();
    wait_until("it is alive twice", || {
        said.extend(words(&manager));
        said.iter().filter(|word| *word == "WATCHDOG=1").count() == 2
    });
    assert_eq!(said[0], "READY=1");
    assert!(said.iter().any(|word| word.starts_with("STATUS=")), "{said:?}");
    collector.signal("-TERM");
    wait_until("it says that it ends", || words(&manager).contains(&"STOPPING=1".to_owned()));
    assert_eq!(collector.wait(), Some(0), "a stop that was wanted is none of a failure");
}

#[test]
fn a_recorder_is_made_to_report_and_left_as_it_was_found() {
    let plant = Plant::start(1);
    let setting = || {
        let mut command = ser_cli();
        command.args(["--port", plant.recorders[0].port(), "config", "--format", "json"]);
        text(&command.output().unwrap().stdout)
    };
    let before = setting();
    let mut command = plant.collect("--hasten 10");
    let mut collector = Running::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
    blink(&plant.recorders[0], 4);
    wait_until("all is archived", || {
        plant.archive().exists() && {
            let archive = Connection::open(plant.archive()).unwrap();
            let count = archive.query_row("SELECT count(*) FROM entry", (), |row| row.get(0));
            count.unwrap_or(0) == 8
        }
    });
    collector.signal("-TERM");
    assert_eq!(collector.wait(), Some(0));
    assert_eq!(setting(), before);
    // The log was looked at once more, so nothing can be missing at the end of what happened.
    let mut command = ser_cli();
    let report = command.args(["report", "--archive"]).arg(plant.archive()).output().unwrap();
    let report = text(&report.stdout);
    assert!(report.contains("8 entries") && !report.contains("not known to be read"), "{report}");
    // Both changes are on record, with who made them.
    let commands = "SELECT count(*) FROM evidence WHERE kind = 'command' \
        AND line LIKE '%auto report%' AND line LIKE '%\"user\":%'";
    assert_eq!(plant.number(commands), 2);
    // For the time that was watched, nothing is missing.
    assert!(plant.number("SELECT count(*) FROM evidence WHERE kind = 'watched'") >= 1);
    assert!(plant.number("SELECT count(*) FROM evidence WHERE kind = 'clock'") >= 1);
}
