//! Packages of Python: `comtrade` in two versions, the reader of the viewer Surfer, and databases.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::plant::{BEGIN_MS, Desk, Log, hostile_names, instants, thirty_hours};
use crate::common::bench::text;
use crate::common::ser_cli;

/// Where `cargo xtask test` puts them.
fn readers() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("../readers")
}

/// What a script prints, as JSON.
fn told(desk: &Desk, older: bool, script: &str) -> Value {
    let python = readers().join("bin/python");
    let mut command = Command::new(python);
    if older {
        command.env("PYTHONPATH", readers().join("older"));
    }
    command.current_dir(desk.0.path()).args(["-c", script]);
    let output = command.output().expect("the readers are there: cargo xtask test --all");
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// A record as `comtrade` reads it.
struct Read {
    ids: Vec<String>,
    /// In milliseconds from the first row on.
    times_ms: Vec<i64>,
    /// By row: the states.
    rows: Vec<Vec<bool>>,
    began: String,
    triggered: String,
}

fn comtrade(desk: &Desk, older: bool, files: &str) -> Read {
    let script = format!(
        "import comtrade, json
record = comtrade.Comtrade(use_double_precision=True)
record.load({files})
print(json.dumps(dict(ids=record.status_channel_ids, times=[float(t) for t in record.time],
    status=[[int(s) for s in channel] for channel in record.status],
    began=str(record.start_timestamp), triggered=str(record.trigger_timestamp))))"
    );
    let read = told(desk, older, &script);
    let times = read["times"].as_array().expect("times");
    let status = read["status"].as_array().expect("channels");
    let row = |row: usize| status.iter().map(|channel| channel[row] == 1).collect();
    let in_ms = |time: &Value| {
        let ms = (time.as_f64().expect("a number") * 1000.0).round();
        format!("{ms}").parse().expect("thirty hours")
    };
    let ids = read["ids"].as_array().expect("names").iter();
    Read {
        ids: ids.map(|id| id.as_str().expect("a name").to_owned()).collect(),
        times_ms: times.iter().map(in_ms).collect(),
        rows: (0..times.len()).map(row).collect(),
        began: read["began"].as_str().expect("a time").to_owned(),
        triggered: read["triggered"].as_str().expect("a time").to_owned(),
    }
}

/// The states of a recorder's inputs, as many as there are points.
fn bits(on: u32, points: usize) -> impl Iterator<Item = bool> {
    (0..points).map(move |input| on >> input & 1 == 1)
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn comtrade_reads_thirty_hours_of_two_recorders_to_the_millisecond() {
    let logs = thirty_hours();
    let desk = Desk::of(&[&logs[0], &logs[1]]);
    desk.export("--format comtrade", "a.cfg");
    desk.export("--format comtrade --data binary", "b.cfg");
    desk.export("--format cff", "a.cff");
    desk.export("--format cff --data binary", "b.cff");
    let expected = instants(&logs);
    let first_ms = expected[0].0 - 1;
    for (older, files) in [
        (false, "'a.cfg', 'a.dat'"),
        (false, "'b.cfg', 'b.dat'"),
        (false, "'a.cff'"),
        (false, "'b.cff'"),
        (true, "'a.cfg', 'a.dat'"),
        (true, "'a.cff'"),
    ] {
        let read = comtrade(&desk, older, files);
        assert_eq!(read.rows.len(), expected.len() + 1, "{files}");
        let rows = read.rows.iter().zip(&read.times_ms).skip(1);
        for ((states, time_ms), (at_ms, on)) in rows.zip(&expected) {
            let of_both: Vec<bool> = bits(on[0], 32).chain(bits(on[1], 32)).collect();
            assert_eq!(*states, of_both, "{files} {at_ms}");
            assert_eq!(*time_ms, at_ms - first_ms, "{files}");
        }
        assert!(read.rows[0].iter().all(|state| !state), "before the first change");
        // The two points of one name are told apart.
        assert_eq!((&*read.ids[13], &*read.ids[45]), ("U1/both", "U2/both"));
        assert!(read.ids.contains(&"U1/Überstrom Süd".to_owned()));
        assert!(read.began < read.triggered && read.began.starts_with("2026-11-22"), "{files}");
    }
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn comtrade_reads_16_17_and_32_channels_with_and_without_a_rate() {
    for channels in [16_u8, 17, 32] {
        let names: Vec<String> = (1..=channels).map(|input| format!("p{input}")).collect();
        let mut log = Log::new("U1", &names);
        log.moves = (0..96).map(|step| (step * 7, 1 << (step % i64::from(channels)))).collect();
        let desk = Desk::of(&[&log]);
        let states = log.states();
        for (number, options) in ["", "--data binary", "--rate 1000", "--rate 1000 --data binary"]
            .into_iter()
            .enumerate()
        {
            desk.export(&format!("--format comtrade {options}"), &format!("{number}.cfg"));
            let files = format!("'{number}.cfg', '{number}.dat'");
            for older in [false, true] {
                // The older one reads no binary files.
                if older && options.contains("binary") {
                    continue;
                }
                let read = comtrade(&desk, older, &files);
                let at = |time_ms: i64| {
                    let before = states.iter().take_while(|(at_ms, _)| *at_ms < time_ms);
                    before.last().map_or(0, |&(_, on)| on)
                };
                assert!(!read.rows.is_empty());
                let points = usize::from(channels);
                for (row, time_ms) in read.rows.iter().zip(&read.times_ms) {
                    assert_eq!(row[..points], bits(at(*time_ms), points).collect::<Vec<_>>());
                    assert!(row[points..].iter().all(|spare| !spare));
                }
                let expected = if options.contains("rate") { 95 * 7 + 2 } else { 97 };
                assert_eq!(read.rows.len(), expected, "{channels} {options}");
            }
        }
    }
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn surfer_reads_every_change_and_what_is_unknown() {
    let logs = thirty_hours();
    let desk = Desk::of(&[&logs[0], &logs[1]]);
    desk.export("--format vcd", "a.vcd");
    let script = "import pywellen, json
wave = pywellen.Waveform('a.vcd')
print(json.dumps({var.full_name: [[time, str(value)] for time, value in var.tv]
    for var in wave.all_vars()}))";
    let signals = told(&desk, false, script);
    let first_ms = logs.iter().map(|log| log.moves[0].0).min().expect("a move") - 1;
    for log in &logs {
        let names = hostile_names();
        let plain = names.iter().position(|name| name == "both").expect("its name");
        let name = format!("Northfield.{}.both", log.name);
        let tv = signals[&name].as_array().unwrap_or_else(|| panic!("{name}: {signals}"));
        let seen: Vec<(i64, &str)> = tv
            .iter()
            .map(|tv| (tv[0].as_i64().expect("a time"), tv[1].as_str().expect("a value")))
            .collect();
        assert_eq!(seen, expected(log, plain, first_ms), "{name}");
    }
    let lost = signals["Northfield.U1.loss"].as_array().expect("events");
    let before = logs[0].moves[209].0 - first_ms + 1;
    assert_eq!(lost.len(), 1);
    assert_eq!(lost[0][0], before * 1000);
    assert!(signals["Northfield.U2.loss"].as_array().expect("events").is_empty());
    let utc = signals["Northfield.utc"].as_array().expect("times");
    let began = utc[0][1].as_str().expect("a time");
    let ms = BEGIN_MS + first_ms;
    let moment = jiff::Timestamp::from_millisecond(ms).expect("a time");
    assert_eq!(began, moment.strftime("%Y-%m-%dT%H:%M:%S%.6fZ").to_string());
}

/// When the state of an input changes on the axis, and to what.
fn expected(log: &Log, input: usize, first_ms: i64) -> Vec<(i64, &'static str)> {
    let mut expected: Vec<(i64, &str)> = vec![(0, "x")];
    let mut tell = |at_ms: i64, value: &'static str| {
        let at_us = (at_ms - first_ms) * 1000;
        if expected.last().is_some_and(|&(_, known)| known == value) {
            return;
        }
        expected.push((at_us, value));
    };
    let states = log.states();
    for (place, &(at_ms, on)) in states.iter().enumerate() {
        let value = |on: u32| if on >> input & 1 == 1 { "1" } else { "0" };
        let before = place.checked_sub(1).map_or(0, |place| states[place].1);
        if log.gap_after == Some(place) {
            tell(states[place - 1].0 + 1, "x");
        }
        tell(at_ms - 1, value(before));
        tell(at_ms, value(on));
    }
    expected
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn duckdb_reads_the_table_with_types_and_every_row() {
    let logs = thirty_hours();
    let desk = Desk::of(&[&logs[0], &logs[1]]);
    desk.export("--format csv", "a.csv");
    let script = "import duckdb, json
rows = duckdb.sql(\"\"\"select recorder, epoch_ms(time), list(input order by input), count(*)
    from read_csv('a.csv') where state is not null group by all order by all\"\"\").fetchall()
types = dict(duckdb.sql(\"select column_name, column_type from (describe from 'a.csv')\").fetchall())
lost = duckdb.sql(\"select note from 'a.csv' where state is null\").fetchall()
print(json.dumps(dict(rows=rows, types=types, lost=lost)))";
    let told = told(&desk, false, script);
    assert_eq!(told["types"]["time"], "TIMESTAMP");
    assert_eq!(told["types"]["utc"], "TIMESTAMP WITH TIME ZONE");
    assert_eq!(told["lost"], serde_json::json!([["lost 3 (exactly) after 210: overwritten"]]));
    same_rows(&told["rows"], &logs);
}

/// Recorder, time and inputs of each entry.
fn same_rows(rows: &Value, logs: &[Log; 2]) {
    let of_log = |log: &Log| -> Vec<Value> {
        let row = |&(at_ms, changed): &(i64, u32)| {
            let inputs: Vec<u32> =
                (1..=32).filter(|input| changed >> (input - 1) & 1 == 1).collect();
            serde_json::json!([log.name, BEGIN_MS + at_ms, inputs, inputs.len()])
        };
        log.moves.iter().map(row).collect()
    };
    let expected: Vec<Value> = logs.iter().flat_map(of_log).collect();
    let rows = rows.as_array().expect("rows");
    assert_eq!(rows.len(), expected.len());
    for (row, expected) in rows.iter().zip(&expected) {
        assert_eq!(row, expected);
    }
}

#[cfg(feature = "parquet")]
#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn databases_read_parquet_with_types_nulls_and_every_row() {
    let logs = thirty_hours();
    let desk = Desk::of(&[&logs[0], &logs[1]]);
    desk.export("--format parquet", "a.parquet");
    let script = "import duckdb, json, pyarrow.parquet
rows = duckdb.sql(\"\"\"select recorder, epoch_ms(utc), list(input order by input), count(*)
    from 'a.parquet' where kind = 'change' group by all order by all\"\"\").fetchall()
lost = duckdb.sql(\"\"\"select recorder, sequence, lost, lost_count, lost_why, input
    from 'a.parquet' where kind = 'loss'\"\"\").fetchall()
table = pyarrow.parquet.read_table('a.parquet')
names = sorted(set(table.column('point').to_pylist()) - {None})
print(json.dumps(dict(rows=rows, lost=lost, names=names, count=table.num_rows,
    unknown=table.column('err_us').null_count, stamp=table.column('stamp')[0].as_py(),
    utc=str(table.schema.field('utc').type), about=table.schema.metadata[b'site'].decode())))";
    let told = told(&desk, false, script);
    same_rows(&told["rows"], &logs);
    let lost = serde_json::json!([["U1", 210, 3, "exactly", "overwritten", null]]);
    assert_eq!(told["lost"], lost);
    // Nobody observed the clocks, so nobody knows how wrong they are.
    assert_eq!(told["unknown"], told["count"]);
    let mut names = hostile_names();
    names.sort();
    assert_eq!(told["names"], serde_json::json!(names));
    assert_eq!(
        (&told["utc"], &told["about"]),
        (&"timestamp[us, tz=UTC]".into(), &"Northfield".into())
    );
    assert!(told["stamp"].as_str().expect("a text").starts_with("2026-11-22T"));
}

/// The changes in a record, as `comtrade` has them: `2027-03-14 19:29:58.104 status A 1`, in UTC if
/// the record's own time is so many hours behind that. (`comtrade` leaves the time code alone.)
fn changes_by_comtrade(desk: &Desk, files: &str, hours: i32) -> Vec<String> {
    let script = format!(
        "import comtrade, json
from datetime import timedelta
from math import ceil
record = comtrade.Comtrade(use_double_precision=True)
record.load({files})
changes = []
for row in range(1, len(record.time)):
    # The millisecond in which it was seen, or the next one.
    us = record.start_timestamp.microsecond + round(float(record.time[row]) * 1e6)
    at = record.start_timestamp.replace(microsecond=0) + timedelta(milliseconds=ceil(us / 1000))
    at += timedelta(hours={hours})
    for name, states in zip(record.status_channel_ids, record.status):
        if states[row] != states[row - 1]:
            changes.append(f'{{at:%Y-%m-%d %H:%M:%S}}.{{at.microsecond // 1000:03}} {{name}} {{states[row]}}')
print(json.dumps(changes))"
    );
    let changes = told(desk, false, &script);
    let texts = changes.as_array().expect("a list").iter();
    texts.map(|change| change.as_str().expect("a text").to_owned()).collect()
}

/// The changes in the same record, as `import` has them.
fn changes_by_import(desk: &Desk, file: &str) -> Vec<String> {
    let mut import = ser_cli();
    import.current_dir(desk.0.path()).args(["import", file, "--zone", "UTC", "--recorder", "F"]);
    let output = import.output().expect("ser-cli runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let records: Vec<Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    let name = |input: &Value| {
        let is_its = |record: &&Value| record["record"] == "point" && record["input"] == *input;
        let point = records.iter().find(is_its).expect("a name");
        point["name"].as_str().expect("a text").to_owned()
    };
    let mut changes = Vec::new();
    for entry in records.iter().filter(|record| record["record"] == "entry") {
        let at = entry["time"].as_str().expect("a time").replace('T', " ");
        let on = entry["state"].as_array().expect("a list");
        for input in entry["changed"].as_array().expect("a list") {
            changes.push(format!("{at} {} {}", name(input), u8::from(on.contains(input))));
        }
    }
    changes
}

#[test]
#[ignore = "needs python-readers: cargo xtask test"]
fn import_reads_the_records_of_others_as_comtrade_does() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/ser-files/tests/import");
    let desk = Desk::of(&[]);
    for (name, hours) in [
        ("comtrade-1999.cfg", 0),
        ("comtrade-1999-binary.cfg", 0),
        ("comtrade-2013-float.cfg", 5),
        ("comtrade-ascii.cff", -1),
        ("comtrade-binary.cff", 0),
    ] {
        let data = name.replace(".cfg", ".dat");
        for file in [name, &data] {
            std::fs::copy(samples.join(file), desk.0.path().join(file)).expect("a file");
        }
        let files = match data == name {
            true => format!("'{name}'"),
            false => format!("'{name}', '{data}'"),
        };
        let theirs = changes_by_comtrade(&desk, &files, hours);
        assert!(!theirs.is_empty(), "{name}");
        assert_eq!(changes_by_import(&desk, name), theirs, "{name}");
    }
}
