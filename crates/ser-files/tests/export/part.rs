//! A part as JSON lines says of its entries what the whole says.

use ser_evidence::history::Collector;
use ser_evidence::incident::{Incident, Which};
use ser_evidence::record::How;
use ser_evidence::site::Site;
use ser_evidence::time::{Bound, Utc};
use ser_evidence::timeline::Timeline;
use ser_files::Source;
use ser_files::export::{Selection, write_csv, write_jsonl};
use ser_files::merged::{CsvStyle, Dialect};

use crate::common::{Log, history, monotonic_us, site};
use crate::{between, recorder};

/// What is told of an entry: its recorder, what its clock showed, and when it was.
type Row = (String, String, Bound<Utc>);

/// The entries from a time on, and whatever is wrong with clocks.
fn told(timeline: &Timeline<'_>, from: &str) -> (Vec<Row>, String) {
    let row = |event| {
        let name = timeline.recorder(event)?.recorder.name.clone();
        let shown = timeline.held(event)?.entry.time.to_string();
        (shown.as_str() >= from).then(|| (name, shown, timeline.moved_utc(event, None)))
    };
    (timeline.entries().filter_map(row).collect(), format!("{:?}", timeline.findings()))
}

/// The part of these logs between two times, written and read again.
fn part(site: &Site, logs: &[&Log], since: &str, until: &str) -> (String, Collector) {
    let history = history(site, logs);
    let timeline = Timeline::new(site, &history);
    written_and_read(&timeline, &between(&timeline, since, until))
}

/// These entries, written and read again.
fn written_and_read(timeline: &Timeline, selection: &Selection) -> (String, Collector) {
    let mut out = Vec::new();
    write_jsonl(&mut out, timeline, selection, "test 1.0").expect("written");
    let text = String::from_utf8(out).expect("UTF-8");
    let mut collector = Collector::new();
    collector.begin_source();
    for told in Source::new(text.as_bytes(), "").expect("ours") {
        let told = told.expect("a record");
        collector.add(&told.recorder, &told.record);
    }
    (text, collector)
}

/// A recorder of whose lives nothing is remembered: its clock was set back after its first entry.
fn set_back(name: &'static str, first: &str, set_ms: u32) -> Log {
    let mut log = Log::of(name, 0);
    log.changes(first, &[7]);
    let set = format!("2026-11-22T09:00:06.{set_ms:03}");
    let at = monotonic_us(&set);
    log.observed(How::Set { broadcast: None }, &set, (at, at + 5000), Some(1000));
    log
}

fn set_back_site() -> Site {
    site(&(recorder("U1", &[(1, "a")]) + &recorder("U2", &[(1, "b")])))
}

#[test]
fn a_clock_that_was_set_before_the_part_is_known_in_it() {
    let site = set_back_site();
    let mut one = set_back("U1", "2026-11-22T13:00:05.588", 662);
    one.changes("2026-11-22T09:00:18.979", &[1]).changes("2026-11-22T09:00:19.089", &[1]);
    let mut other = set_back("U2", "2026-11-22T13:00:05.496", 895);
    other.changes("2026-11-22T09:00:19.082", &[1]).changes("2026-11-22T09:10:00.000", &[1]);
    let (since, until) = ("2026-11-22T09:00:18.000", "2026-11-22T09:00:30.000");
    let whole = history(&site, &[&one, &other]);
    let whole = Timeline::new(&site, &whole);
    let (mut expected, findings) = told(&whole, since);
    expected.retain(|(_, shown, _)| shown.as_str() < until);
    assert_eq!(expected.len(), 3);

    let (text, collector) = part(&site, &[&one, &other], since, until);
    let history = collector.finish(&site);
    let timeline = Timeline::new(&site, &history);
    assert_eq!(told(&timeline, since), (expected, findings), "{text}");
    // Found by what the part holds: the entries before the sets are outside of it.
    assert_eq!(text.matches("\"fellow\":{\"ahead\":1,").count(), 2, "{text}");
    assert!(!text.contains("2026-11-22T13:00:05.588\",\"changed\":[7],\"state\":[7],\"seq"));
}

#[test]
fn what_a_clock_showed_before_it_was_set_silently_is_not_taken_for_a_part_after_that() {
    let site = set_back_site();
    for life in [0, 1] {
        let mut log = Log::of("U1", life);
        log.changes("2026-11-22T13:00:05.588", &[7]);
        let at = monotonic_us("2026-11-22T13:00:06.000");
        log.observed(How::Query, "2026-11-22T13:00:06.000", (at, at + 5000), Some(1000));
        log.changes("2026-11-22T13:00:07.000", &[7]);
        // Somebody set it back, and nobody says so.
        log.changes("2026-11-22T09:00:18.979", &[1]).changes("2026-11-22T19:00:19.089", &[1]);
        let (text, collector) =
            part(&site, &[&log], "2026-11-22T20:00:00.000", "2026-11-22T23:59:00.000");
        assert!(text.contains("19:00:19.089") && !text.contains("\"sequence\":3"), "{text}");
        let history = collector.finish(&site);
        let timeline = Timeline::new(&site, &history);
        let (rows, findings) = told(&timeline, "2026-11-22");
        assert_eq!(rows.len(), 1);
        assert!(!rows[0].2.is_known(), "life {life}: nobody observed that clock: {text}");
        assert_eq!(findings, "[]");
        // What belongs to the part is in it.
        let (text, _) = part(&site, &[&log], "2026-11-22T13:00:06.500", "2026-11-22T13:00:08.000");
        assert!(text.contains("\"query\""), "{text}");
    }
}

/// Where a guess is overruled, the list is in another order than that of its keys.
#[test]
fn a_part_holds_all_entries_of_its_incident_in_whatever_order_they_are() {
    let site = site(&recorder("U1", &[(1, "a")]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T09:00:18.979", &[1]).changes("2026-11-22T09:00:19.089", &[1]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let mut incident = Incident::pick(&timeline, Which::Last).expect("some entries");
    incident.events.reverse();
    let mut out = Vec::new();
    let selection = Selection::of(&timeline, &incident);
    let counted = write_jsonl(&mut out, &timeline, &selection, "test 1.0").expect("written");
    assert_eq!(counted.entries, 2);
}

/// What `--spreadsheet-safe` puts before texts is taken away again where our own reader reads them.
#[test]
fn a_table_that_is_safe_for_spreadsheets_is_read_as_it_was() {
    let site = site(&recorder("=52-1", &[(1, "10:30")]));
    let mut log = Log::of("=52-1", 0x1234_5678_9012_3456);
    log.changes("2026-11-22T09:00:18.979", &[1]).changes("2026-11-22T09:00:19.089", &[1]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let records = |is_spreadsheet_safe| {
        let style = CsvStyle { dialect: Dialect::Rfc4180, is_spreadsheet_safe, has_names: true };
        let mut out = Vec::new();
        let all = Selection::everything();
        write_csv(&mut out, &timeline, &all, style).expect("written");
        let text = String::from_utf8(out).expect("UTF-8");
        assert_eq!(text.contains(",'=52-1,"), is_spreadsheet_safe, "{text}");
        assert_eq!(text.contains(",'10:30,"), is_spreadsheet_safe, "{text}");
        let read: Vec<_> = Source::new(text.as_bytes(), "file").expect("ours").collect();
        read.into_iter().map(|told| told.expect("a record")).collect::<Vec<_>>()
    };
    let plain = records(false);
    assert!(plain.len() == 2 && plain.iter().all(|told| told.recorder == "=52-1"));
    assert_eq!(records(true), plain);
}

#[test]
fn a_part_that_is_read_and_written_has_gaps_at_its_ends_and_is_the_same_from_then_on() {
    let site = set_back_site();
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T09:00:01.000", &[1])
        .changes("2026-11-22T09:10:00.000", &[1])
        .changes("2026-11-22T09:10:00.010", &[2])
        .changes("2026-11-22T09:20:00.000", &[1]);
    let (first, collector) =
        part(&site, &[&log], "2026-11-22T09:09:00.000", "2026-11-22T09:11:00.000");
    let again = |collector: Collector| {
        let history = collector.finish(&site);
        written_and_read(&Timeline::new(&site, &history), &Selection::everything())
    };
    let (second, collector) = again(collector);
    let (third, _) = again(collector);
    assert_eq!(second, third);
    let lines = |text: &str| {
        let kept = text.lines().filter(|line| !line.contains("\"record\":\"gap\""));
        kept.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(lines(&second), lines(&first));
    assert_eq!((first.matches("\"gap\"").count(), second.matches("\"gap\"").count()), (0, 1));
}
