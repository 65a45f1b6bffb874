//! Commands that read archives, as a user runs them.
#![cfg(all(unix, feature = "archive"))]

mod common;

use common::archived::{BEGIN_US, DAY_US, HOUR_US, Plant, utc};
use serde_json::{Number, Value};

/// A report without what may be told of less when less is read.
fn told(mut report: Value) -> Value {
    for recorder in report["recorders"].as_array_mut().expect("recorders") {
        // The stretch without a gap is known as far as it was read.
        for end in ["unbroken_from", "unbroken_to"] {
            recorder.as_object_mut().expect("an object").remove(end).expect("a stretch");
        }
    }
    report
}

/// A text with times to the second only: the best guess within what is known of a clock depends, by a
/// millisecond or two, on what else was read. What is known does not.
fn coarse(text: &str) -> String {
    let (mut coarse, mut rest) = (String::new(), text);
    while let Some((before, fraction)) = rest.split_once('.') {
        coarse.push_str(before);
        let is_time = before.len() > 6 && before[before.len() - 6..].starts_with(':');
        let digits = fraction.bytes().take_while(u8::is_ascii_digit).count();
        rest = if is_time { &fraction[digits..] } else { fraction };
    }
    coarse + rest
}

/// Microseconds are rounded here and there, and where a clock is hardly known, what lies far away
/// narrows that a little.
fn are_near(one: &Number, other: &Number) -> bool {
    let pair = one.as_i64().zip(other.as_i64());
    pair.is_some_and(|(one, other)| {
        one == other || one.abs() > 1000 && (one - other).abs() <= 2 + one.abs() / 100
    })
}

/// Where two values differ.
fn differences(at: &str, one: &Value, other: &Value) -> Vec<String> {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) if one.keys().eq(other.keys()) => {
            let of = |(key, value)| differences(&format!("{at}/{key}"), value, &other[key]);
            one.iter().flat_map(of).collect()
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            let pairs = one.iter().zip(other).enumerate();
            let of = |(index, (one, other))| differences(&format!("{at}/{index}"), one, other);
            pairs.flat_map(of).collect()
        }
        (Value::Number(one), Value::Number(other)) if are_near(one, other) => Vec::new(),
        _ if one == other => Vec::new(),
        (Value::String(one), Value::String(other)) if coarse(one) == coarse(other) => Vec::new(),
        _ => vec![format!("{at}: {one} and {other}")],
    }
}

#[test]
fn a_report_from_an_archive_says_what_one_from_all_its_records_says() {
    for seed in 0..3 {
        let plant = Plant::of_months(seed);
        let around = |day: i64, hour: i64| {
            format!("--around {}", utc(BEGIN_US + day * DAY_US + hour * HOUR_US))
        };
        let between = |from: i64, until: i64| {
            let time = |day| utc(BEGIN_US + day * DAY_US);
            format!("--since {} --until {}", time(from), time(until))
        };
        let mut choices = vec!["--last".to_owned(), String::new(), between(-9, 3)];
        choices.extend((0..120).step_by(7).map(|day| around(day, 11)));
        choices.extend([29, 30, 31, 32, 33, 60, 74, 75, 89, 90, 91].map(|day| around(day, 6)));
        choices.extend([between(28, 35), between(58, 62), between(89, 92), between(119, 400)]);
        for choice in choices {
            let of = |source: &str| {
                told(plant.json(&format!("report {source} --site plant.toml {choice}")))
            };
            let (part, all) = (of("--archive plant.db"), of("--input all.jsonl"));
            let differs = differences("", &part, &all);
            assert!(differs.is_empty(), "seed {seed}: {choice}: {differs:#?}");
        }
    }
}
