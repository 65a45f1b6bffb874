//! Names from a site file where a recorder is talked to.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use common::bench::{Bench, text};
use common::{Running, ser_cli};
use ser_sim::testing::{Kind, PATIENCE};

/// A bench with a site file, whose recorders are at these ports.
fn site(bench: &Bench, clock: &str) -> PathBuf {
    let file = bench.folder.path().join("north.toml");
    let link = bench.link();
    let text = format!(
        "site = \"Northfield\"\ntime_zone = \"Europe/Berlin\"\n\n\
         [[recorder]]\nname = \"U1-SER1\"\nport = \"{}\"\nclock = \"{clock}\"\n\n\
         [[recorder]]\nname = \"U1-SER2\"\nport = \"tcp://localhost:1\"\n\n\
         [[recorder]]\nname = \"paper\"\n\n\
         [[point]]\nrecorder = \"U1-SER1\"\ninput = 3\nname = \"52-1 closed\"\non = \"CLOSED\"\n\
         off = \"OPEN\"\n",
        link.display()
    );
    fs::write(&file, text).expect("a file");
    file
}

/// A command without a port in the environment.
fn command(bench: &Bench, arguments: &str) -> Command {
    let mut command = bench.command(arguments);
    command.env_remove("SER_PORT").env("SER_SITE", bench.folder.path().join("north.toml"));
    command
}

fn run(bench: &Bench, arguments: &str) -> Output {
    command(bench, arguments).output().expect("ser-cli runs")
}

#[test]
fn tables_have_names_and_files_have_numbers() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    site(&bench, "local");
    bench.contacts("0,3,1\n10,4,1\n20,3,0\n", 3);

    let table = text(&run(&bench, "read --recorder U1-SER1").stdout);
    let changes: Vec<&str> =
        table.lines().map(|line| line.rsplit("  ").next().unwrap_or_default()).collect();
    assert_eq!(changes, ["changes", "52-1 closed CLOSED", "4 ON", "52-1 closed OPEN"]);

    let csv = text(&run(&bench, "read --recorder U1-SER1 --format csv").stdout);
    assert!(!csv.contains("52-1") && csv.lines().count() == 4, "{csv}");

    let status = text(&run(&bench, "status --recorder U1-SER1").stdout);
    assert!(
        status.starts_with("site            Northfield\nrecorder        U1-SER1\n"),
        "{status}"
    );
    assert!(status.contains("inputs on       4\n"), "{status}");
}

#[test]
fn a_recorder_is_known_by_its_port_however_that_is_spelled() {
    let mut bench = Bench::start(Kind::Native, &[]);
    site(&bench, "local");
    bench.contacts("0,3,1\n", 1);
    let folder = bench.folder.path();
    let mut relative = command(&bench, "read --port ./unit");
    let output = relative.current_dir(folder).output().expect("ser-cli runs");
    assert!(text(&output.stdout).contains("52-1 closed CLOSED"), "{output:?}");

    // A port that the file does not know is told, and read nevertheless.
    let other = folder.join("other");
    std::os::unix::fs::symlink("/dev/null", &other).expect("a link");
    let output = run(&bench, &format!("read --port {}", other.display()));
    assert!(text(&output.stderr).contains("has no recorder at"), "{output:?}");
}

#[test]
fn a_recorder_that_is_named_wins_over_the_port_of_the_environment() {
    let bench = Bench::start(Kind::Native, &[]);
    site(&bench, "local");
    let mut named = command(&bench, "status --recorder U1-SER1");
    let output = named.env("SER_PORT", "/dev/null").output().expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    // And a port on the command line wins over the one in the file.
    let mut named = command(&bench, "status --recorder U1-SER2 --port");
    let output = named.arg(bench.link()).output().expect("ser-cli runs");
    assert!(text(&output.stdout).contains("recorder        U1-SER2"), "{output:?}");
}

#[test]
fn which_recorder_is_meant_has_to_be_clear() {
    let bench = Bench::start(Kind::Native, &[]);
    site(&bench, "local");
    for (arguments, told) in [
        ("status", "name it with --recorder: the file has U1-SER1, U1-SER2, paper"),
        (
            "status --recorder U1-SER9",
            "has no recorder U1-SER9\nhint: it has U1-SER1, U1-SER2, paper",
        ),
        ("status --recorder paper", "paper has no port in"),
    ] {
        let output = run(&bench, arguments);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(2), String::new()));
        assert!(text(&output.stderr).contains(told), "{}", text(&output.stderr));
    }
    let without = bench.run("status --recorder U1-SER1");
    assert_eq!(without.status.code(), Some(2));
    assert!(text(&without.stderr).contains("name the file with --site"), "{without:?}");
}

#[test]
fn a_bad_site_file_is_told_before_anybody_is_asked() {
    let bench = Bench::start(Kind::Native, &[]);
    fs::write(bench.folder.path().join("north.toml"), "site = 7\n").expect("a file");
    let output = run(&bench, "status");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).starts_with("error[missing-key]"), "{}", text(&output.stderr));
    // Commands that reach nobody do not need it.
    assert_eq!(run(&bench, "encode read --from 1 --count 1").status.code(), Some(0));
}

#[test]
fn a_clock_is_set_to_what_the_site_file_says() {
    let bench = Bench::start(Kind::Native, &[]);
    for (clock, zone, offset_s) in [("utc", "UTC", 0), ("+05:30", "+05:30", 19_800)] {
        site(&bench, clock);
        let now = || jiff::Timestamp::now().as_second() + offset_s;
        let before = now();
        let output = run(&bench, "clock set --recorder U1-SER1");
        let told = format!("set to {zone} time, as the site file says\nexact to ± ");
        assert!(text(&output.stderr).starts_with(&told), "{output:?}");
        let set: jiff::civil::DateTime = text(&output.stdout).trim().parse().expect("a time");
        let set = jiff::tz::TimeZone::UTC.to_timestamp(set).expect("a time").as_second();
        assert!((before..=now() + 1).contains(&set), "{clock}: {output:?}");
    }
}

#[test]
fn a_new_site_file_has_what_the_recorder_says() {
    let mut bench = Bench::start(Kind::Native, &["--model", "ser160"]);
    bench.contacts("0,3,1\n", 1);
    bench.ok("config --size 512");
    let link = bench.link();
    let missing = bench.folder.path().join("missing");
    let file = bench.folder.path().join("new.toml");
    let mut new = ser_cli();
    new.args(["site", "new", "--retries", "0", "-p"]).arg(&link).arg("-p").arg(&missing);
    let output = new.arg("-o").arg(&file).output().expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(text(&output.stderr).contains("is in the file with its port only"), "{output:?}");
    let shown = ser_cli().args(["site", "show", "--format", "json"]).arg(&file).output();
    let shown: serde_json::Value = serde_json::from_slice(&shown.expect("it runs").stdout).unwrap();
    let [first, second] = [0, 1].map(|index| &shown["recorders"][index]);
    assert_eq!(first["port"], link.to_str().unwrap());
    assert_eq!((&first["model"], &first["log_size"]), (&"ser160".into(), &512.into()));
    assert_eq!(first["original"], false);
    assert_eq!((&second["name"], &second["model"]), (&"SER2".into(), &serde_json::Value::Null));
}

#[test]
fn a_new_site_file_has_each_recorder_once() {
    for (ports, told) in [
        (["tcp://localhost:1", "tcp://127.0.0.1:1"], "are the same port"),
        (["tcp://localhost:1", "tcp://localhost:1"], "is given twice"),
    ] {
        let new = ["site", "new", "--port", ports[0], "--port", ports[1]];
        let output = ser_cli().args(new).output().expect("ser-cli runs");
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(text(&output.stderr).contains(told), "{output:?}");
    }
}

#[test]
fn all_recorders_of_a_site_are_watched_in_one_list() {
    let (mut first, mut second) =
        (Bench::start(Kind::Native, &[]), Bench::start(Kind::Native, &["--model", "ser160"]));
    let file = first.folder.path().join("north.toml");
    let recorder =
        |name: &str, port: &str| format!("[[recorder]]\nname = \"{name}\"\nport = \"{port}\"\n");
    let text_of_file = format!(
        "site = \"Northfield\"\ntime_zone = \"UTC\"\n{}{}{}[[point]]\nrecorder = \"U1-SER2\"\n\
         input = 3\nname = \"52-1 closed\"\n",
        recorder("U1-SER1", first.link().to_str().unwrap()),
        recorder("U1-SER2", second.link().to_str().unwrap()),
        recorder("silent", "tcp://localhost:1"),
    );
    fs::write(&file, text_of_file).expect("a file");
    first.contacts("0,3,1\n", 1);
    second.contacts("0,3,1\n", 1);

    let watch = || {
        let mut command = command(&first, "watch --interval 100ms");
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Running::start(&mut command)
    };
    let mut watching = watch();
    let (lines, told) = (watching.lines(), watching.told());
    let next = || lines.recv_timeout(PATIENCE).expect("a line");
    assert_eq!(next(), "  recorder  entry  time                     changes");
    let mut rows = [next(), next()];
    rows.sort_by_key(|row| row.get(2..).map(str::to_owned));
    assert!(rows[0].contains(" U1-SER1       1  ") && rows[0].ends_with("  3 ON"), "{rows:?}");
    assert!(rows[1].contains(" U1-SER2       1  "), "{rows:?}");
    assert!(rows[1].ends_with("  52-1 closed ON"), "{rows:?}");
    assert_eq!(
        told.recv_timeout(PATIENCE).expect("a line"),
        "watching U1-SER1, U1-SER2, silent until Ctrl-C"
    );
    assert_eq!(
        told.recv_timeout(PATIENCE).expect("a line"),
        "warning: silent: nothing listens at tcp://localhost:1"
    );
    assert_eq!(watching.interrupt(), Some(0));

    // What was shown is not shown again.
    second.contacts("0,3,0\n", 1);
    let mut watching = watch();
    let lines = watching.lines();
    let next = || lines.recv_timeout(PATIENCE).expect("a line");
    assert!(next().starts_with("  recorder"));
    assert!(next().ends_with("  52-1 closed OFF"));
    assert_eq!(watching.interrupt(), Some(0));
}

#[test]
fn a_list_of_several_recorders_is_a_table() {
    let bench = Bench::start(Kind::Native, &[]);
    site(&bench, "local");
    for (arguments, told) in [
        ("watch --format csv", "files are of one recorder each"),
        ("watch --log-size 7", "--log-size is of one recorder"),
    ] {
        let output = run(&bench, arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(text(&output.stderr).contains(told), "{output:?}");
    }
}

#[test]
fn the_recorders_of_a_bus_have_their_names_and_their_clocks_one_setting() {
    let folder = tempfile::tempdir().unwrap();
    let (window, file) = (folder.path().join("host"), folder.path().join("north.toml"));
    let mut sim = ser_cli();
    sim.args(["sim", "--node", "5", "--node", "9:ser160", "--genius"]).arg(&window);
    let mut sim = Running::start(sim.stdout(Stdio::piped()).stderr(Stdio::null()));
    assert!(sim.lines().recv_timeout(PATIENCE).expect("a port").starts_with("geni:"));
    let write = |clock: &str| {
        let recorder = |name: &str, node: u8, clock: &str| {
            format!(
                "[[recorder]]\nname = \"{name}\"\nport = \"geni:{}?node={node}\"\nclock = \"{clock}\"\n",
                window.display()
            )
        };
        let (first, second) = (recorder("U1-SER1", 5, "utc"), recorder("U1-SER2", 9, clock));
        let text = format!("site = \"A\"\ntime_zone = \"UTC\"\n{first}{second}");
        fs::write(&file, text).expect("a file");
    };
    // The only bus in the file is meant.
    let genius = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_SITE", &file).args(["--timeout", "20s", "genius"]);
        command.args(arguments.split_whitespace()).output().expect("ser-cli runs")
    };
    write("+05:30");
    assert_eq!(
        text(&genius("globals").stdout),
        "node  inputs  on\n   5      32  U1-SER1: none\n   9      16  U1-SER2: none\n"
    );
    let refused = genius("broadcast clock");
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr)
            .contains("one broadcast cannot set U1-SER1 to UTC and U1-SER2 to +05:30"),
        "{refused:?}"
    );
    write("+00:00");
    assert_eq!(genius("broadcast clock").status.code(), Some(0));

    // One window is for all recorders on its bus, and they are read at the same time.
    let mut merge = ser_cli();
    merge.env("SER_SITE", &file).env("SER_STATE_DIR", folder.path());
    let output = merge.args(["--timeout", "20s", "merge", "--format", "jsonl"]).output();
    let output = output.expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let (list, told) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(told, "reading U1-SER1, U1-SER2 …\n");
    for recorder in ["U1-SER1", "U1-SER2"] {
        let watched = format!("{{\"record\":\"watched\",\"recorder\":\"{recorder}\"");
        assert!(list.contains(&watched), "{list}");
    }
}
