//! Waveforms: what is known of each state, and from when to when.

use std::collections::HashSet;

use ser_evidence::history::Collector;
use ser_evidence::record::{Gap, Life, Lost, Record, Why};
use ser_evidence::timeline::Timeline;
use ser_files::export::{Refused, Selection, write_vcd};

use crate::common::{Log, history, site};
use crate::{NOWHERE, between, exported, recorder};

/// Everything after the declarations, without the texts `utc` and `err_us`.
fn changes(vcd: &[u8]) -> Vec<String> {
    let text = String::from_utf8(vcd.to_vec()).expect("UTF-8");
    let (_, body) = text.split_once("$enddefinitions $end\n").expect("declarations");
    body.lines().filter(|line| !line.starts_with('s')).map(str::to_owned).collect()
}

fn vcd(site_text: &str, logs: &[&Log]) -> Vec<String> {
    let site = site(site_text);
    let (out, _) = exported(&site, logs, |out, timeline, selection| {
        write_vcd(out, timeline, selection, &NOWHERE)
    });
    changes(&out)
}

/// The times, which must rise.
fn times(lines: &[String]) -> Vec<u64> {
    let times = lines.iter().filter_map(|line| line.strip_prefix('#'));
    let times: Vec<u64> = times.map(|time| time.parse().expect("a number")).collect();
    assert!(times.is_sorted_by(|one, other| one < other), "{times:?}");
    times
}

#[test]
fn a_state_is_unknown_until_an_entry_shows_it_and_after_a_gap() {
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1])
        .changes("2026-11-22T10:00:00.260", &[2])
        .loses(3)
        .changes("2026-11-22T10:00:01.000", &[1]);
    let lines = vcd(&recorder("U1", &[(1, "a"), (2, "b")]), &[&log]);
    // `&` is the loss.
    let expected = "#0 $dumpvars x) x* $end 0) 0* #1000 1) #11000 1* #12000 x) x* 1& #750000 1) 1* \
                    #751000 0) #752000";
    assert_eq!(lines.join(" "), expected);
}

#[test]
fn a_change_that_was_not_recorded_leaves_the_other_inputs_known() {
    let site_text = recorder("U1", &[(1, "a"), (2, "b")]);
    let lines = vcd(&site_text, &[&unrecorded()]);
    let expected = "#0 $dumpvars x) x* $end 0) 0* #1000 1) 1* #2000 x* 1& #250000 0* #251000 0) \
                    #252000";
    assert_eq!(lines.join(" "), expected);
}

/// Inputs 1 and 2 go on, and when input 1 goes off, input 2 is off as well.
fn unrecorded() -> Log {
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1, 2]);
    log.forgets(&[2]);
    log.changes("2026-11-22T10:00:00.500", &[1]);
    log
}

#[test]
fn recorders_are_on_one_axis_on_which_time_never_goes_back() {
    let (mut one, mut other) = (Log::of("U1", 1), Log::of("U2", 2));
    for ms in 0..50 {
        one.changes(&format!("2026-11-22T10:00:00.{:03}", ms * 7), &[1]);
        other.changes(&format!("2026-11-22T10:00:00.{:03}", ms * 11), &[1]);
    }
    let site_text = recorder("U1", &[])
        + &recorder("U2", &[])
        + "delay_ms = { closing = [20, 30], \
                     opening = [20, 30] }\n";
    let lines = vcd(&site_text, &[&one, &other]);
    let times = times(&lines);
    assert!(times.len() > 90, "{times:?}");
    // The second recorder sees its contacts 25 ms late, so they are drawn that much earlier.
    assert_eq!(lines.iter().filter(|line| ["0)", "1)"].contains(&line.as_str())).count(), 51);
}

#[test]
fn entries_after_the_clock_was_set_back_keep_their_order() {
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1])
        .changes("2026-11-22T10:00:05.000", &[1])
        .changes("2026-11-22T10:00:00.300", &[1])
        .changes("2026-11-22T10:00:00.301", &[1]);
    let lines = vcd(&recorder("U1", &[(1, "a")]), &[&log]);
    times(&lines);
    let states: String = lines.iter().filter(|line| line.ends_with(')')).cloned().collect();
    assert_eq!(states, "x)0)1)0)1)0)", "no change is swallowed: {lines:?}");
}

#[test]
fn a_loss_at_the_very_end_is_before_the_end_of_the_drawing() {
    let site = site(&recorder("U1", &[(1, "a")]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]);
    let mut collector = Collector::new();
    log.records().iter().for_each(|record| collector.add("U1", record));
    let (life, why) = (Life::from_bits(1), Why::LogBeganAnew);
    let gap = Gap { life, after: Some(1), lost: Lost::Unknown, why };
    collector.add("U1", &Record::Gap(gap));
    let history = collector.finish(&site);
    let timeline = Timeline::new(&site, &history);
    let mut out = Vec::new();
    write_vcd(&mut out, &timeline, &Selection::everything(), &NOWHERE).expect("written");
    let lines = changes(&out);
    times(&lines);
    assert_eq!(lines.join(" "), "#0 $dumpvars x) $end 0) #1000 1) #2000 x) 1& #2001");
}

#[test]
fn more_signals_than_signs_have_names_of_their_own() {
    let names: Vec<String> = (1..=32).map(|input| format!("point {input}")).collect();
    let points: Vec<(u8, &str)> = (1..=32).zip(names.iter().map(String::as_str)).collect();
    let mut text = String::new();
    let recorders = ["U1", "U2", "U3", "U4"];
    recorders.iter().for_each(|name| text += &recorder(name, &points));
    let site = site(&text);
    let all: Vec<u8> = (1..=32).collect();
    let logs: Vec<Log> = (1..)
        .zip(recorders)
        .map(|(life, name)| {
            let mut log = Log::of(name, life);
            log.changes("2026-11-22T10:00:00.250", &all);
            log
        })
        .collect();
    let logs: Vec<&Log> = logs.iter().collect();
    let (out, _) = exported(&site, &logs, |out, timeline, selection| {
        write_vcd(out, timeline, selection, &NOWHERE)
    });
    let text = String::from_utf8(out.clone()).expect("UTF-8");
    let ids = text.lines().filter(|line| line.starts_with("$var"));
    let ids: HashSet<&str> = ids.map(|line| line.split(' ').nth(3).expect("an id")).collect();
    assert_eq!(ids.len(), 1 + 4 * (32 + 3));
    // Each goes on once.
    let on = changes(&out);
    let on: HashSet<&String> = on.iter().filter(|line| line.starts_with('1')).collect();
    assert_eq!(on.len(), 4 * 32);
}

#[test]
fn what_was_before_a_part_is_known_in_it() {
    let site = site(&recorder("U1", &[(1, "a"), (2, "b")]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.000", &[2])
        .changes("2026-11-22T10:01:00.000", &[1])
        .changes("2026-11-22T10:02:00.000", &[2]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let part = between(&timeline, "2026-11-22T10:00:30.000", "2026-11-22T10:01:30.000");
    let mut out = Vec::new();
    write_vcd(&mut out, &timeline, &part, &NOWHERE).expect("written");
    assert_eq!(changes(&out).join(" "), "#0 $dumpvars x) x* $end 0) 1* #1000 1) #2000");
}

#[test]
fn what_is_missing_over_a_whole_part_is_told_at_its_beginning() {
    let site = site(&(recorder("U1", &[(1, "a")]) + &recorder("U2", &[(1, "c")])));
    let (mut one, mut other) = (Log::of("U1", 1), Log::of("U2", 2));
    one.changes("2026-11-22T10:00:00.000", &[1]).loses(5).changes("2026-11-22T10:09:00.000", &[1]);
    other.changes("2026-11-22T10:05:00.000", &[1]);
    let history = history(&site, &[&one, &other]);
    let timeline = Timeline::new(&site, &history);
    let part = between(&timeline, "2026-11-22T10:04:00.000", "2026-11-22T10:06:00.000");
    let mut out = Vec::new();
    let counted = write_vcd(&mut out, &timeline, &part, &NOWHERE).expect("written");
    assert_eq!((counted.entries, counted.losses), (1, 1));
    let lines = changes(&out).join(" ");
    assert_eq!(lines, "#0 $dumpvars x) x- $end 0- 1& #1000 1- #2000");
}

#[test]
fn a_clock_that_was_never_set_has_no_place_on_the_axis() {
    let site = site(&recorder("U1", &[]));
    let mut log = Log::of("U1", 1);
    log.changes("1970-01-01T00:00:05.000", &[1]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let refused =
        write_vcd(&mut Vec::new(), &timeline, &Selection::everything(), &NOWHERE).unwrap_err();
    assert!(matches!(refused, Refused::Empty), "{refused}");
}

#[test]
fn hostile_names_end_no_declaration() {
    let hostile = ["$end", "a $end $var", "[0]", "a.b", "<script>", "\u{5d0}\u{5d1}"];
    let points: Vec<(u8, &str)> = (1..).zip(hostile).collect();
    let site = site(&recorder("U$end", &points));
    let mut log = Log::of("U$end", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]);
    let (out, _) = exported(&site, &[&log], |out, timeline, selection| {
        write_vcd(out, timeline, selection, &NOWHERE)
    });
    let text = String::from_utf8(out).expect("UTF-8");
    for line in text.lines().filter(|line| line.starts_with('$') && line.len() > 12) {
        let is_whole = line.ends_with(" $end") && line.matches('$').count() == 2;
        assert!(is_whole || ["$dumpvars", "$comment"].contains(&line), "{line}");
    }
}
