//! What was found about clocks, for people and for programs.

use std::io::{self, Write};

use ser_console::Harmless;
use ser_evidence::time::{Moment, stamp};
use ser_proto::{ClockReading, ClockSource};
use serde_json::{Value, json};
use unicode_width::UnicodeWidthStr;

use super::ask::{Answer, Told};
use super::drift::Rate;
use crate::output::{PROGRAM, ago, offset};

/// The drift is shown where it is known to this, in parts per billion.
const TELLING_PPB: i64 = 500_000;

/// A recorder, and what came of asking it, or why it was not reached.
pub(super) type Row = (String, Result<Answer, String>);

/// This computer's doubt of UTC, and who says so.
pub(super) type HostDoubt = Option<(u64, &'static str)>;

/// As a table, with the doubt of this computer below it.
pub(super) fn table(out: &mut dyn Write, rows: &[Row], doubt: HostDoubt) -> io::Result<()> {
    const HEADER: [&str; 7] =
        ["recorder", "shows", "ahead", "drift", "source", "set ago", "answers"];
    let mut cells: Vec<Vec<String>> = vec![HEADER.map(str::to_owned).to_vec()];
    for (name, answer) in rows {
        let name = Harmless(name).line();
        cells.push(match answer {
            Ok(Answer::Told(told)) => of_told(name, told),
            Ok(Answer::Original) => vec![name, "cannot be asked: an original recorder".to_owned()],
            Ok(Answer::Silent) => vec![name, "does not answer".to_owned()],
            Err(why) => vec![name, format!("not reached: {}", Harmless(why).line())],
        });
    }
    let width = |column: usize| {
        let whole = cells.iter().filter(|row| row.len() == HEADER.len() || column == 0);
        whole.filter_map(|row| row.get(column)).map(|cell| cell.width()).max().unwrap_or_default()
    };
    let widths: Vec<usize> = (0..HEADER.len()).map(width).collect();
    for row in &cells {
        let mut line = String::new();
        for (cell, width) in row.iter().zip(&widths) {
            line.push_str(cell);
            line.push_str(&" ".repeat(width.saturating_sub(cell.width()) + 2));
        }
        writeln!(out, "{}", line.trim_end())?;
    }
    match doubt {
        Some((us, who)) => writeln!(
            out,
            "\nthis computer's clock is within {} ms of UTC, as {who} says",
            us.div_ceil(1000)
        )?,
        None => writeln!(out, "\nhow far this computer's clock is from UTC is not known")?,
    }
    out.flush()
}

fn of_told(name: String, told: &Told) -> Vec<String> {
    let Told { reading, ahead_us, rate, .. } = told;
    let shows = stamp_of(reading.clock_us);
    let drift = rate.filter(|rate| (rate.most_ppb - rate.least_ppb) / 2 <= TELLING_PPB);
    vec![
        name,
        format!("{} {}", shows.as_deref().unwrap_or("no time"), told.setting),
        match (reading.source, &shows) {
            (ClockSource::NeverSet, _) => "never set".to_owned(),
            (_, None) => "not comparable".to_owned(),
            (_, Some(_)) => offset(*ahead_us),
        },
        drift.map_or_else(|| "not known".to_owned(), self::drift),
        source(reading),
        ago(reading.age_s),
        told.answers.to_string(),
    ]
}

/// The stamp that a clock gives, which is its time cut to milliseconds; `None` outside 1970–2069.
fn stamp_of(clock_us: i64) -> Option<String> {
    let cut_us = clock_us.checked_sub(clock_us.rem_euclid(1000))?;
    stamp(Moment::from_us(cut_us)).map(|stamp| stamp.to_string())
}

/// As `host, RS-232`, and how far from that the recorder says its clock may be.
fn source(reading: &ClockReading) -> String {
    let name = match reading.source {
        ClockSource::NeverSet => "none".to_owned(),
        ClockSource::Battery => "battery".to_owned(),
        ClockSource::HostOverRs232 => "host, RS-232".to_owned(),
        ClockSource::HostOverGenius => "host, Genius".to_owned(),
        ClockSource::Pps => "PPS".to_owned(),
        ClockSource::IrigB => "IRIG-B".to_owned(),
        ClockSource::Other(code) => format!("code {code}"),
    };
    match reading.doubt_us {
        Some(us) => format!("{name} ± {us} us"),
        None => name,
    }
}

/// As `+12.5 ± 0.8 ppm`.
fn drift(rate: Rate) -> String {
    let ppm = |ppb: i64| ppb as f64 / 1000.0;
    let middle = rate.least_ppb.midpoint(rate.most_ppb);
    let half = (rate.most_ppb - middle).max(middle - rate.least_ppb);
    // Rounded up, with the rounding of the middle.
    format!("{:+.1} ± {:.1} ppm", ppm(middle), ((half + 50) as f64 / 100.0).ceil() / 10.0)
}

/// As one object for programs.
pub(super) fn json(out: &mut dyn Write, rows: &[Row], doubt: HostDoubt) -> io::Result<()> {
    let all = json!({
        "schema": 1,
        "program": PROGRAM,
        "utc_doubt_us": doubt.map(|(us, _)| us),
        "recorders": rows.iter().map(of_row).collect::<Vec<_>>(),
    });
    serde_json::to_writer_pretty(&mut *out, &all)?;
    writeln!(out)?;
    out.flush()
}

fn of_row((name, answer): &Row) -> Value {
    let told = match answer {
        Ok(Answer::Told(told)) => told,
        Ok(Answer::Original) => return json!({ "recorder": name, "answer": "original" }),
        Ok(Answer::Silent) => return json!({ "recorder": name, "answer": "silent" }),
        Err(why) => return json!({ "recorder": name, "answer": "not reached", "why": why }),
    };
    let Told { reading, utc_us, setting, ahead_us, rate, answers, .. } = &**told;
    json!({
        "recorder": name,
        "answer": "told",
        "shows": stamp_of(reading.clock_us),
        "shows_us": reading.clock_us,
        "zone": setting.to_string(),
        "utc_us": utc_us,
        "ahead": { "least_us": ahead_us.0, "most_us": ahead_us.1 },
        "drift": rate.map(|rate| json!({
            "least_ppb": rate.least_ppb,
            "most_ppb": rate.most_ppb,
            "over_us": rate.over_us,
        })),
        "source": reading.source.to_string(),
        "source_code": reading.source.code(),
        "set_ago_s": reading.age_s,
        "own_doubt_us": reading.doubt_us,
        "own_drift_ppb": reading.drift_ppb,
        "answers": answers,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_counts_microseconds_shows_the_stamp_that_it_would_give() {
        assert_eq!(stamp_of(1_795_348_800_250_123).as_deref(), Some("2026-11-22T12:00:00.250"));
        assert_eq!(stamp_of(i64::MIN), None);
        assert_eq!(stamp_of(i64::MAX), None);
    }

    #[test]
    fn a_rate_is_rounded_and_its_doubt_rounded_up() {
        let rate = |least_ppb, most_ppb| drift(Rate { least_ppb, most_ppb, over_us: 1 });
        assert_eq!(rate(12_000, 13_000), "+12.5 ± 0.6 ppm");
        assert_eq!(rate(-20_000, -10_000), "-15.0 ± 5.1 ppm");
    }

    #[test]
    fn who_cannot_be_asked_has_a_row_that_says_why() {
        let rows: [Row; 3] = [
            ("U1".to_owned(), Ok(Answer::Original)),
            ("Unit 2".to_owned(), Err("nothing listens".to_owned())),
            ("U\x1b3".to_owned(), Ok(Answer::Silent)),
        ];
        let mut out = Vec::new();
        table(&mut out, &rows, Some((20_000, "the site file"))).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(lines[0], "U1        cannot be asked: an original recorder");
        assert_eq!(lines[1], "Unit 2    not reached: nothing listens");
        assert!(lines[2].ends_with("does not answer") && !text.contains('\x1b'), "{text}");
        assert_eq!(lines[4], "this computer's clock is within 20 ms of UTC, as the site file says");
        let mut out = Vec::new();
        json(&mut out, &rows, None).unwrap();
        let all: Value = serde_json::from_slice(&out).unwrap();
        let answers: Vec<&str> = all["recorders"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| row["answer"].as_str().unwrap())
            .collect();
        assert_eq!(answers, ["original", "not reached", "silent"]);
    }
}
