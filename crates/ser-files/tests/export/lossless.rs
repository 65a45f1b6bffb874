//! JSON lines hold everything, and CSV every entry and loss.

use ser_evidence::history::Collector;
use ser_evidence::record::{Gap, How, Life, Lost, Record, Why};
use ser_evidence::site::Site;
use ser_evidence::timeline::Timeline;
use ser_files::Source;
use ser_files::export::{Selection, write_csv, write_jsonl};
use ser_files::merged::{CsvStyle, Dialect};

use crate::common::{Log, monotonic_us, site};
use crate::recorder;

/// What the records of these sources are as JSON lines.
fn jsonl(site: &Site, sources: &[Vec<(String, Record)>]) -> String {
    let mut collector = Collector::new();
    for source in sources {
        collector.begin_source();
        source.iter().for_each(|(recorder, record)| collector.add(recorder, record));
    }
    let history = collector.finish(site);
    let timeline = Timeline::new(site, &history);
    let mut out = Vec::new();
    write_jsonl(&mut out, &timeline, &Selection::everything(), "test 1.0").expect("written");
    String::from_utf8(out).expect("UTF-8")
}

fn read(text: &str) -> Vec<(String, Record)> {
    let source = Source::new(text.as_bytes(), "").expect("ours");
    source.map(|told| told.expect("a record")).map(|told| (told.recorder, told.record)).collect()
}

fn of(log: &Log, recorder: &str) -> Vec<(String, Record)> {
    log.records().iter().map(|record| (recorder.to_owned(), record.clone())).collect()
}

#[test]
fn what_was_exported_and_read_is_exported_byte_for_byte() {
    let site = site(&(recorder("U1", &[(1, "a")]) + &recorder("U2", &[])));
    let mut one = Log::of("U1", 1);
    let set = monotonic_us("2026-11-22T10:00:00.000");
    one.observed(How::Set { broadcast: Some(7) }, "2026-11-22T10:00:00.000", (set, set + 5), None);
    one.changes("2026-11-22T10:00:00.250", &[1])
        .loses(7)
        .tells_overwritten(1, 7)
        .changes("2026-11-22T10:00:01.250", &[1, 32])
        .changes("2026-11-22T09:00:01.250", &[5]);
    let mut other = Log::of("U2", 2);
    other.changes("1970-01-01T00:00:00.250", &[1]).forgets(&[9]);
    other.changes("1970-01-01T00:00:00.350", &[2]);
    // The same place of the log with another content.
    let mut contradicting = Log::of("U1", 1);
    contradicting.changes("2026-11-22T10:00:00.251", &[1]);
    let mut ended = of(&other, "U2");
    let why = Why::LogBeganAnew;
    let gap = Gap { life: Life::from_bits(2), after: Some(2), lost: Lost::Unknown, why };
    ended.push(("U2".to_owned(), Record::Gap(gap)));
    let sources = [of(&one, "U1"), ended, of(&contradicting, "U1")];
    let first = jsonl(&site, &sources);
    let again = jsonl(&site, &[read(&first)]);
    assert_eq!(first, again);
    for kind in ["entry", "gap", "clock"] {
        assert!(first.contains(&format!("\"record\":\"{kind}\"")), "{first}");
    }
    assert_eq!(first.matches("\"sequence\":1,").count(), 3, "both contents are there: {first}");
}

#[test]
fn a_reading_without_a_life_stays_one() {
    let site = Site::unknown();
    let unnamed = |recorder: &'static str| {
        let mut log = Log::of(recorder, 0);
        log.changes("2026-11-22T10:00:00.250", &[1]).changes("2026-11-22T10:00:00.350", &[1]);
        of(&log, recorder)
    };
    let first = jsonl(&site, &[unnamed("U1"), unnamed("U2")]);
    assert_eq!(first, jsonl(&site, &[read(&first)]));
}

#[test]
fn what_a_list_lost_ahead_of_its_oldest_row_is_kept() {
    let site = Site::unknown();
    let mut list = Log::of("U1", 7);
    list.is_list().tells(0, Lost::AtLeast(1), Why::NotReached);
    list.changes("2026-11-22T10:00:00.250", &[1]).tells(1, Lost::Unknown, Why::NotReached);
    list.changes("2026-11-22T10:00:00.350", &[1]);
    let first = jsonl(&site, &[of(&list, "U1")]);
    assert_eq!(first.matches("\"record\":\"gap\"").count(), 2, "{first}");
    assert_eq!(first, jsonl(&site, &[read(&first)]));
}

#[test]
fn csv_is_read_back_with_every_entry_and_loss() {
    let site = site(&recorder("U1", &[(1, "a, \\\"b\\\"")]));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1])
        .loses(7)
        .tells_overwritten(1, 7)
        .changes("2026-11-22T10:00:01.250", &[1, 32])
        .forgets(&[3, 4])
        .changes("2026-11-22T10:00:02.250", &[2]);
    let mut collector = Collector::new();
    log.records().iter().for_each(|record| collector.add("U1", record));
    let history = collector.finish(&site);
    let timeline = Timeline::new(&site, &history);
    let mut out = Vec::new();
    let style = CsvStyle { dialect: Dialect::Rfc4180, is_spreadsheet_safe: true, has_names: true };
    let counted = write_csv(&mut out, &timeline, &Selection::everything(), style).expect("written");
    assert_eq!((counted.entries, counted.losses), (3, 2));
    let text = String::from_utf8(out).expect("UTF-8");
    assert_eq!(text.matches('\n').count(), text.matches("\r\n").count());
    let found: Vec<Record> = read(&text).into_iter().map(|(_, record)| record).collect();
    let entries = |records: &[Record]| -> Vec<(Option<u64>, u32)> {
        let entry = |record: &Record| match record {
            Record::Entry(entry) => Some((entry.sequence, entry.entry.changed.0)),
            _ => None,
        };
        records.iter().filter_map(entry).collect()
    };
    assert_eq!(entries(&found), entries(log.records()));
    let gaps: Vec<(Option<u64>, Lost, Why)> = found
        .iter()
        .filter_map(|record| match record {
            Record::Gap(gap) => Some((gap.after, gap.lost, gap.why)),
            _ => None,
        })
        .collect();
    let expected = [
        (Some(1), Lost::Exactly(7), Why::Overwritten),
        (Some(9), Lost::Unknown, Why::NotRecorded(0b1100)),
    ];
    assert_eq!(gaps, expected);
}
