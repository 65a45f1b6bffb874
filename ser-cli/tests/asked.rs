//! What can be asked of a recorder of ours beyond the manual, and what is said of an original one.
#![cfg(unix)]

mod common;

use std::fs;
use std::process::Stdio;

use common::bench::{Bench, text};
use common::original::Original;
use common::{Running, ser_cli};
use ser_sim::testing::{Kind, PATIENCE};
use serde_json::Value;

ser_sim::with_both_kinds! {
    filters_are_set_and_what_is_not_given_stays,
    what_a_recorder_cannot_have_is_refused_before_anything_is_sent,
    counters_are_told_with_their_meaning,
    status_tells_identity_clock_filters_and_losses,
    what_was_left_out_is_told_by_whoever_reads_the_log,
}

fn json(output: &str) -> Value {
    serde_json::from_str(output).expect("JSON")
}

/// Ten changes of input 3 in 90 ms, after this time. With 5 changes in a second, the fifth and those
/// behind it are left out.
fn chatter_after(ms: u32) -> String {
    let step = |step: u32| format!("{},3,{}", ms + 10 * step, (step + 1) % 2);
    (0..10).map(step).collect::<Vec<_>>().join("\n")
}

/// The same at once.
fn chatter() -> String {
    chatter_after(0)
}

/// What lines of a file say that was left out of input 3, look by look.
fn looks(jsonl: &str) -> Vec<u64> {
    let looks = jsonl.lines().map(json).filter(|line| line["record"] == "suppressed");
    looks.map(|look| look["left_out"]["3"].as_u64().unwrap_or(0)).collect()
}

/// The row of an input behind its number: neighbours that are alike share one.
fn row(table: &str, input: u8) -> String {
    let has_it = |line: &&str| {
        let numbers = line.trim_start().split("  ").next().unwrap_or_default();
        numbers.split(", ").any(|numbers| {
            let (first, last) = numbers.split_once('-').unwrap_or((numbers, numbers));
            let ends = first.parse::<u8>().ok().zip(last.parse::<u8>().ok());
            ends.is_some_and(|(first, last)| (first..=last).contains(&input))
        })
    };
    let row = table.lines().find(has_it).unwrap_or_else(|| panic!("no input {input}: {table}"));
    let (_, behind) = row.trim_start().split_once("  ").expect("columns");
    behind.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn filters_are_set_and_what_is_not_given_stays(kind: Kind) {
    let bench = Bench::start(kind, &["--debounce", "3"]);
    let table = bench.ok("filter");
    assert_eq!((row(&table, 1), row(&table, 32)), ("3 ms off".into(), "3 ms off".into()));

    let set = bench.run("filter set --input 3,5-6 --chatter 10/1s");
    assert!(text(&set.stderr).contains("changed: inputs 3, 5, 6"), "{}", text(&set.stderr));
    let table = text(&set.stdout);
    for input in [3, 5, 6] {
        assert_eq!(row(&table, input), "3 ms 10 changes in 1 s 2 s");
    }
    assert_eq!(row(&table, 4), "3 ms off");
    bench.ok("filter set --input 3 --debounce 5ms --rearm 4s");
    let all = bench.ok("filter set --input all --debounce off");
    assert_eq!(row(&all, 3), "off 10 changes in 1 s 4 s");
    assert_eq!(row(&all, 32), "off off");
    assert_eq!(bench.ok("filter"), all);

    let again = bench.run("filter set --input all --debounce off");
    assert!(text(&again.stderr).contains("nothing to change"), "{}", text(&again.stderr));

    let json = json(&bench.ok("filter clear --input 3 --format json"));
    assert_eq!(json["filters"][2]["chatter"], Value::Null);
    assert_eq!(json["filters"][4]["chatter"]["rearm_ms"], 2000);
    bench.ok("filter set --input all --debounce 7ms --chatter off");
    let last = bench.ok("filter");
    assert!((1..=32).all(|input| row(&last, input) == "7 ms off"), "{last}");
}

fn what_a_recorder_cannot_have_is_refused_before_anything_is_sent(kind: Kind) {
    let bench = Bench::start(kind, &["--model", "ser160"]);
    let before = bench.ok("filter");
    for (arguments, told) in [
        ("filter set --input 17 --debounce 5ms", "this recorder has inputs 1 to 16"),
        ("filter set --input 3 --rearm 2s", "input 3 has none"),
        ("filter set --input 3 --chatter 10/2s --rearm 1s", "cannot be shorter than the window"),
        ("filter set --input 3 --debounce 300ms", "0ms to 255ms"),
        ("filter set --input 3 --chatter 8/2s", "from 9 changes on"),
        ("filter set --point breaker --debounce 5ms", "is a name in a site file"),
        ("filter set --input 3", "required"),
    ] {
        let refused = bench.fails(2, arguments);
        assert!(refused.contains(told), "{arguments}: {refused}");
    }
    assert_eq!(bench.ok("filter"), before);
}

fn counters_are_told_with_their_meaning(kind: Kind) {
    let mut bench = Bench::start(kind, &[]);
    let table = bench.ok("diagnostics");
    assert!(table.starts_with("Recorder and RS-232 port\n"), "{table}");
    assert!(table.contains("Input changes that found the capture queue full."), "{table}");
    assert!(table.ends_with("Inputs\nno input has chattered\n"), "{table}");

    bench.ok("filter set --input 3 --chatter 5/1s --rearm 1s");
    bench.contacts(&chatter(), 4);
    let value = |json: &Value, name: &str| {
        let counters = json["counters"].as_array().expect("counters");
        counters.iter().find(|counter| counter["name"] == name).expect("a counter")["value"].clone()
    };
    common::wait_until("all have moved", || {
        let json = json(&bench.ok("diagnostics --format json"));
        value(&json, "suppressed_3") == 6
    });
    assert!(bench.ok("diagnostics").contains("suppressed_3         6"));
    let filters = json(&bench.ok("filter --format json"));
    assert_eq!(filters["filters"][2]["left_out"], 6);
    assert_eq!(filters["filters"][3]["left_out"], 0);
}

fn status_tells_identity_clock_filters_and_losses(kind: Kind) {
    let bench = Bench::start(kind, &[]);
    let status = bench.ok("status");
    // A board may have a battery-backed clock.
    assert!(status.contains("\nclock source    ") && !status.contains("set by a host"), "{status}");
    assert!(status.contains("\nfilters         off, on all inputs\n"), "{status}");

    bench.ok("clock set");
    bench.ok("filter set --input 3 --debounce 5ms");
    let status = bench.ok("status");
    // An emulator may be kept from running for longer than the image can bridge, and says so.
    let counters = if matches!(kind, Kind::Native) { "no loss" } else { "" };
    for line in [
        "extension       level 1: time, filters, diagnostics",
        "clock source    set by a host over RS-232, ",
        "                input 3: debounce 5 ms\n",
        &format!("counters        {counters}"),
    ] {
        assert!(status.contains(&format!("\n{line}")), "{line}: {status}");
    }
    let json = json(&bench.ok("status --format json"));
    assert_eq!(json["identity"]["level"], 1);
    assert_eq!((&json["inputs"], &json["recording"]), (&32.into(), &true.into()));
    assert_eq!(json["filters"][2]["debounce_ms"], 5);
    assert_eq!(json["settings"]["line_baud"], 9600);
    assert!(json["counters"].as_array().expect("counters").len() > 40);
    // It was set a moment ago, to within what an emulator on a busy computer takes.
    let ahead = |place: usize| json["clock"]["ahead_us"][place].as_i64().expect("a number");
    assert!(ahead(0) <= ahead(1), "{json}");
    assert!(ahead(0) < 60_000_000 && ahead(1) > -60_000_000, "{json}");
}

fn what_was_left_out_is_told_by_whoever_reads_the_log(kind: Kind) {
    let mut bench = Bench::start(kind, &[]);
    bench.ok("clock set");
    bench.ok("filter set --input 3 --chatter 5/1s --rearm 1s");
    let quiet = bench.run("read --format jsonl");
    assert_eq!(
        (text(&quiet.stderr).contains("left out"), looks(&text(&quiet.stdout))),
        (false, vec![0])
    );

    bench.contacts(&chatter(), 4);
    common::wait_until("all have moved", || {
        json(&bench.ok("filter --format json"))["filters"][2]["left_out"] == 6
    });
    let read = bench.run("read --new --format jsonl");
    let told = text(&read.stderr);
    assert!(
        told.contains("input 3: 6 changes left out by its chatter filter since its power-up"),
        "{told}"
    );
    assert_eq!(looks(&text(&read.stdout)), [6]);
    // It is known now, and not told again.
    let again = bench.run("read --new");
    assert_eq!(text(&again.stderr), "nothing new\n");
    // A reading that remembers nothing tells all of it.
    assert!(text(&bench.run("read").stderr).contains("input 3: 6 changes left out"));
    assert!(!text(&bench.run("read --log-size 2048").stderr).contains("left out"), "not asked");

    // Until then the input is believed again.
    bench.contacts(&chatter_after(1500), 4);
    common::wait_until("all have moved again", || {
        json(&bench.ok("filter --format json"))["filters"][2]["left_out"] == 12
    });
    let mut watch = Running::start(
        bench.command("watch --format jsonl").stdout(Stdio::piped()).stderr(Stdio::piped()),
    );
    let (lines, told) = (watch.lines(), watch.told());
    let line = || lines.recv_timeout(PATIENCE).expect("a line of watch");
    let seen = std::iter::repeat_with(line).find(|line| line.contains("suppressed"));
    assert_eq!(looks(&seen.expect("a look")), [12]);
    assert_eq!(watch.interrupt(), Some(0));
    let told: Vec<String> = told.iter().collect();
    let more = "input 3: 6 more changes left out by its chatter filter";
    assert!(told.iter().any(|line| line.contains(more)), "{told:?}");
    assert_eq!(
        looks(&lines.iter().collect::<Vec<_>>().join("\n")),
        [12],
        "and once more at the end"
    );

    let site = bench.folder.path().join("north.toml");
    let link = bench.link();
    fs::write(
        &site,
        format!(
            "site = \"N\"\ntime_zone = \"UTC\"\n\n[[recorder]]\nname = \"U1\"\nport = \"{}\"\n\n\
             [[point]]\ninput = 3\nname = \"52-1\"\n",
            link.display()
        ),
    )
    .expect("a file");
    let report = bench.ok(&format!("report --site {}", site.display()));
    let report = report.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(report.contains("left out U1: input 3 (52-1), up to 12 changes"), "{report}");
}

#[test]
fn what_grows_is_shown_until_ctrl_c() {
    let mut bench = Bench::start(Kind::Native, &["--tcp-idle", "never"]);
    bench.ok("filter set --input 3 --chatter 5/1s --rearm 1s");
    let mut follow = Running::start(
        bench.command("diagnostics --every 50ms").stdout(Stdio::piped()).stderr(Stdio::piped()),
    );
    let told = follow.told();
    let first = told.recv_timeout(PATIENCE).expect("a line");
    assert!(first.contains("every 0.05 s, until Ctrl-C"), "{first}");
    let input = bench.sim.0.stdin.as_mut().expect("piped");
    std::io::Write::write_all(input, format!("ms,input,state\n{}\n\n", chatter()).as_bytes())
        .expect("the simulator reads");
    let lines = follow.lines();
    let mut seen = 0;
    while seen < 6 {
        let line = lines.recv_timeout(PATIENCE).expect("a line");
        let words: Vec<_> = line.split_whitespace().collect();
        assert_eq!(words[1], "suppressed_3", "{line}");
        seen += words[2].trim_start_matches('+').parse::<u32>().expect("a number");
        assert_eq!(words[4], seen.to_string(), "{line}");
    }
    assert_eq!((seen, follow.interrupt()), (6, Some(0)));
}

#[test]
fn an_original_recorder_has_nothing_of_this_and_is_hardly_asked() {
    let original = Original::start();
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_PORT", original.port()).args(["--timeout", "300ms"]);
        command.args(arguments.split_whitespace()).output().expect("ser-cli runs")
    };
    for (arguments, what) in [
        ("filter", "its filters"),
        ("filter set --input 3 --debounce 5ms", "its filters"),
        ("diagnostics", "its counters"),
    ] {
        let output = run(arguments);
        let told = text(&output.stderr);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), String::new()));
        assert!(told.contains("an original recorder") && told.contains(what), "{told}");
    }
    // Each time a command of the manual, and then one question.
    assert_eq!(original.heard(), "RI".repeat(3));
}

#[test]
fn what_a_recorder_does_not_answer_takes_nothing_else_away() {
    let of_ours = Original::that_says_who_it_is();
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_PORT", of_ours.port()).args(["--timeout", "300ms"]);
        let output = command.args(arguments.split_whitespace()).output().expect("ser-cli runs");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let status = run("status");
    let has = |line: &str| status.lines().any(|found| found == line);
    assert!(has("events          3 since the last erase (modulo 65536)"), "{status}");
    assert!(has("firmware        1.2.3"), "{status}");
    let told = |fact: &str| status.lines().any(|line| line.starts_with(fact));
    assert_eq!(["clock", "filters", "counters"].map(told), [false, false, true], "{status}");
    let counters = run("diagnostics");
    assert!(counters.contains("frames_interrupted         7"), "{counters}");
}

#[test]
fn the_status_of_an_original_recorder_is_what_it_can_tell() {
    let original = Original::start();
    let run = |arguments: &str| {
        let mut command = ser_cli();
        command.env("SER_PORT", original.port()).args(["--timeout", "300ms"]);
        let output = command.args(arguments.split_whitespace()).output().expect("ser-cli runs");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        output
    };
    let output = run("status");
    assert_eq!(
        text(&output.stdout),
        "inputs          16\n\
         events          3 since the last erase (modulo 65536)\n\
         next entry      4\n\
         latest event    2026-11-22T10:00:00.003 (entry 3)\n\
         inputs on       1\n"
    );
    let told = text(&output.stderr);
    assert!(told.contains("an original recorder does not answer"), "{told}");
    // It has shown by its silence that it knows no queries, and is not asked who it is.
    assert!(!original.heard().contains('I'), "{}", original.heard());
    let json = json(&text(&run("status --format json").stdout));
    assert_eq!((&json["total"], &json["identity"]), (&3.into(), &Value::Null));
    assert_eq!((&json["clock"], &json["filters"]), (&Value::Null, &Value::Null));
}

#[test]
fn one_that_the_site_file_calls_original_is_not_asked_at_all() {
    let original = Original::start();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("north.toml");
    let port = original.port();
    let site = format!(
        "site = \"N\"\ntime_zone = \"UTC\"\n\n[[recorder]]\nname = \"old\"\nport = \"{port}\"\n\
         original = true\nlog_size = 512\n"
    );
    fs::write(&file, site).expect("a file");
    let mut command = ser_cli();
    command.arg("--site").arg(&file).args(["--recorder", "old", "filter"]);
    let output = command.output().expect("ser-cli runs");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("original = true"), "{}", text(&output.stderr));
    assert_eq!(original.heard(), "");
}
