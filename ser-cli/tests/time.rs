//! `time`: the clocks of recorders beside this computer's, held against what they were set to.
#![cfg(unix)]

mod common;

use std::fs;
use std::process::Output;

use common::bench::{Bench, text};
use common::is_kept;
use ser_sim::testing::Kind;
use serde_json::Value;

fn run(bench: &Bench, arguments: &str) -> Output {
    let mut command = bench.command(arguments);
    command.env("TZ", "UTC").env_remove("SER_PORT");
    command.output().expect("ser-cli runs")
}

fn json(bench: &Bench, arguments: &str) -> Value {
    let output = run(bench, &format!("{arguments} --format json"));
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// How far a recorder is ahead, at least and at most, in microseconds.
fn ahead_us(told: &Value) -> (i64, i64) {
    let end = |name: &str| told["ahead"][name].as_i64().expect("an end");
    (end("least_us"), end("most_us"))
}

#[test]
fn a_clock_is_as_far_ahead_as_it_was_set_in_the_zone_of_the_site() {
    let bench = Bench::start(Kind::Native, &[]);
    let site = bench.folder.path().join("north.toml");
    let port = bench.link();
    let write = |clock: &str| {
        let text = format!(
            "site = \"Northfield\"\ntime_zone = \"Asia/Kolkata\"\n\n[host]\nutc_doubt_ms = 20\n\n\
             [[recorder]]\nname = \"U1\"\nport = \"{}\"\nclock = \"{clock}\"\n\n\
             [[recorder]]\nname = \"U2\"\nport = \"tcp://localhost:1\"\n",
            port.display()
        );
        fs::write(&site, text).expect("a file");
    };
    write("utc");
    let site_option = format!("--site {}", site.display());
    assert!(run(&bench, &format!("clock set {site_option} --recorder U1")).status.success());
    let all = json(&bench, &format!("time {site_option}"));
    assert_eq!(all["utc_doubt_us"], 20_000);
    let [one, two] = &all["recorders"].as_array().expect("rows")[..] else { panic!("{all}") };
    assert_eq!((&one["recorder"], &one["answer"]), (&"U1".into(), &"told".into()));
    assert_eq!((&two["recorder"], &two["answer"]), (&"U2".into(), &"not reached".into()));
    // It was set to this computer's time, as exactly as that goes.
    let (least, most) = ahead_us(one);
    assert!(least < 20_000 && most > -20_000 && least < most, "{one}");
    assert_eq!((&one["source_code"], &one["zone"]), (&2.into(), &"UTC".into()));

    // The same clock in the zone of the site is five and a half hours late.
    write("local");
    let all = json(&bench, &format!("time {site_option}"));
    let late_us = 19_800_000_000;
    let (least, most) = ahead_us(&all["recorders"][0]);
    assert!(least < 20_000 - late_us && most > -20_000 - late_us, "{all}");

    let table = text(&run(&bench, &format!("time {site_option}")).stdout);
    let row = |row: usize| table.lines().nth(row).expect("a row");
    assert!(row(0).starts_with("recorder  shows"), "{table}");
    let late = ["Asia/Kolkata  -19799.9", "Asia/Kolkata  -19800.0"];
    assert!(late.iter().any(|late| row(1).contains(late)), "{table}");
    assert!(row(1).contains("host, RS-232"), "{table}");
    assert!(row(2).starts_with("U2        not reached: nothing listens"), "{table}");
    assert!(row(4).contains("within 20 ms of UTC"), "{table}");
}

#[test]
fn a_longer_look_tells_the_drift_and_keeps_what_it_saw() {
    let bench = Bench::start(Kind::Native, &[]);
    let port = format!("--port {}", bench.link().display());
    let set = run(&bench, &format!("clock set --at 2026-11-22T10:00:00 {port}"));
    assert!(set.status.success(), "{}", text(&set.stderr));
    let all = json(&bench, &format!("time --for 2s {port}"));
    let told = &all["recorders"][0];
    assert!(told["answers"].as_u64() >= Some(8), "{told}");
    let end = |name: &str| told["drift"][name].as_i64().expect("a rate");
    // The simulated clock is this computer's.
    assert!(end("least_ppb") <= 0 && end("most_ppb") >= 0, "{told}");
    assert!(end("over_us") >= 2_000_000, "{told}");

    let told = text(&run(&bench, &format!("time --format jsonl {port}")).stdout);
    assert_eq!(told.matches("\"how\":\"query\"").count(), 1, "{told}");
    let state = fs::read_dir(bench.folder.path().join("state")).expect("a folder");
    let kept: String = state
        .map(|file| file.expect("a file").path())
        .filter(|path| is_kept(path))
        .map(|path| fs::read_to_string(path).expect("text"))
        .collect();
    assert!(kept.contains(told.lines().nth(1).expect("a record")), "{kept}");
    // Twice by the setting, and twice here.
    assert_eq!(kept.matches("\"how\":\"query\"").count(), 4, "{kept}");
}

#[test]
fn nobody_who_can_be_asked_is_a_failure() {
    let bench = Bench::start(Kind::Native, &[]);
    let output = run(&bench, "time --port tcp://localhost:1");
    assert_eq!(output.status.code(), Some(1));
    let output = run(&bench, "time");
    assert_eq!(output.status.code(), Some(2), "which recorder?");
}
