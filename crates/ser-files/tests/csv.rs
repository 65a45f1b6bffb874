//! CSV: rows become entries again, and what is wrong is named where it is.

use proptest::prelude::*;
use ser_evidence::record::{EntryRecord, Gap, Life, Lost, Record, Told, Why};
use ser_files::csv::Reader;
use ser_files::{Problem, ReadError, Source};
use ser_proto::Inputs;

const HEADER: &str = "entry,time,input,state,sequence,life,note\n";

fn read(text: &str) -> Vec<Result<Told, ReadError>> {
    Source::new(text.as_bytes(), "U1").expect("a file of ours").collect()
}

fn entries(text: &str) -> Vec<EntryRecord> {
    let entry = |told: Result<Told, ReadError>| match told.expect("no error").record {
        Record::Entry(entry) => entry,
        other => panic!("{other:?}"),
    };
    read(text).into_iter().map(entry).collect()
}

/// Sequence, changed, state and known inputs.
fn gist(entry: &EntryRecord) -> (Option<u64>, u32, u32, u32) {
    (entry.sequence, entry.entry.changed.0, entry.entry.state.0, entry.known.0)
}

fn row(sequence: u64, input: u8, state: u8) -> String {
    format!("{sequence},2026-11-22T10:00:00.{sequence:03},{input},{state},{sequence},0,\n")
}

#[test]
fn the_rows_of_an_entry_become_one_again() {
    let text = format!(
        "{HEADER}\
         2048,2026-11-22T10:00:00.250,3,1,5000,00000000000000ab,\n\
         2048,2026-11-22T10:00:00.250,17,0,5000,00000000000000ab,\n\
         1,2026-11-22T10:00:00.250,4,1,5001,00000000000000ab,the clock went back\n"
    );
    let entries = entries(&text);
    assert_eq!(
        entries.iter().map(gist).collect::<Vec<_>>(),
        [
            (Some(5000), 1 << 2 | 1 << 16, 1 << 2, 1 << 2 | 1 << 16),
            (Some(5001), 1 << 3, 1 << 2 | 1 << 3, 1 << 2 | 1 << 3 | 1 << 16),
        ]
    );
    assert_eq!(entries[0].number, 2048);
    assert_eq!(entries[0].life, Life::from_bits(0xAB));
    assert_eq!(entries[0].entry.time.to_string(), "2026-11-22T10:00:00.250");
    assert_eq!(read(&text)[0].as_ref().unwrap().recorder, "U1");
}

#[test]
fn a_state_is_known_until_something_may_be_missing() {
    let ends = |between: &str, after: &str| {
        let text = HEADER.to_owned() + &row(1, 1, 1) + between + after;
        let last = read(&text).into_iter().filter_map(Result::ok).last().expect("an entry");
        let Record::Entry(entry) = last.record else { panic!() };
        (entry.entry.state, entry.known)
    };
    let both = (Inputs(0b11), Inputs(0b11));
    let only = (Inputs(0b10), Inputs(0b10));
    assert_eq!(ends("", &row(2, 2, 1)), both);
    assert_eq!(ends("", &row(3, 2, 1)), only, "a jump");
    assert_eq!(ends("", &row(1, 2, 1).replace(",0,\n", ",00000000000000ab,\n")), only, "a life");
    assert_eq!(ends(HEADER, &row(2, 2, 1)), only, "a header");
    assert_eq!(ends("torn\n", &row(2, 2, 1)), only, "a damaged row");
    let loss = ",,,,1,0,\"lost an unknown number after 1: not recorded, inputs 1 3\"\n";
    assert_eq!(ends(loss, &row(2, 2, 1)), only, "a loss");
}

#[test]
fn a_file_of_several_recorders_says_whose_each_row_is() {
    let header = HEADER.replace('\n', ",recorder,utc,utc_earliest,utc_latest\n");
    let of = |row: String, recorder: &str| row.replace('\n', &format!(",{recorder},,,\n"));
    let lost = ",,,,2,0,lost 1 (exactly) after 2: overwritten,U2,,,\n";
    let missed = ",,,,,,lost an unknown number: not reached,\"U3, new\",,,\n";
    let rows = [
        of(row(1, 1, 1), "U1"),
        of(row(1, 9, 1), "U2"),
        of(row(2, 2, 1), "U1"),
        of(row(2, 9, 0), "U2"),
        lost.to_owned(),
        of(row(3, 3, 1), "U1"),
        of(row(4, 4, 1), "U2"),
        missed.to_owned(),
    ];
    let told = |told: Result<Told, ReadError>| {
        let Told { recorder, record } = told.expect("no error");
        match record {
            Record::Entry(entry) => (recorder, gist(&entry)),
            Record::Gap(gap) => (recorder, (gap.after, 0, 0, 0)),
            other => panic!("{other:?}"),
        }
    };
    let read: Vec<_> = read(&format!("{header}{}", rows.concat())).into_iter().map(told).collect();
    let of = |name: &str| name.to_owned();
    assert_eq!(
        read,
        [
            (of("U1"), (Some(1), 1, 1, 1)),
            (of("U2"), (Some(1), 1 << 8, 1 << 8, 1 << 8)),
            (of("U1"), (Some(2), 0b10, 0b11, 0b11)),
            (of("U2"), (Some(2), 1 << 8, 0, 1 << 8)),
            (of("U2"), (Some(2), 0, 0, 0)),
            (of("U1"), (Some(3), 0b100, 0b111, 0b111)),
            (of("U2"), (Some(4), 0b1000, 0b1000, 0b1000)),
            (of("U3, new"), (None, 0, 0, 0)),
        ],
        "what is known of a recorder ends where something is missing of it, and only there"
    );
}

#[test]
fn every_loss_is_read() {
    let after = |after, lost, why| Gap { life: Life::from_bits(0xAB), after, lost, why };
    for (row, gap) in [
        (
            ",,,,120,00000000000000ab,lost 37 (exactly) after 120: overwritten",
            after(Some(120), Lost::Exactly(37), Why::Overwritten),
        ),
        (
            ",,,,,00000000000000ab,lost 1 (at least): overwritten",
            after(None, Lost::AtLeast(1), Why::Overwritten),
        ),
        (
            ",,,,7,00000000000000ab,lost an unknown number after 7: log began anew",
            after(Some(7), Lost::Unknown, Why::LogBeganAnew),
        ),
        (
            ",,,,0,00000000000000ab,\"lost an unknown number after 0: not recorded, inputs 1 3\"",
            after(Some(0), Lost::Unknown, Why::NotRecorded(0b101)),
        ),
        (
            ",,,,0,00000000000000ab,lost an unknown number after 0: not reached",
            after(Some(0), Lost::Unknown, Why::NotReached),
        ),
    ] {
        let read = read(&format!("{HEADER}{row}\n"));
        let [Ok(Told { record, .. })] = &read[..] else { panic!("{read:?}") };
        assert_eq!(*record, Record::Gap(gap), "{row}");
        let note = row.splitn(7, ',').last().map(|note| note.trim_matches('"'));
        assert_eq!(Some(ser_files::csv::loss_note(&gap).as_str()), note);
    }
}

#[test]
fn a_file_of_an_earlier_version_is_read_also_where_it_was_continued() {
    let text = "entry,time,input,state\r\n\
                7,2026-11-22T10:00:00.250,3,1\r\n\
                8,2026-11-22T10:00:00.251,4,1\r\n\
                entry,time,input,state,sequence,life,note\r\n\
                9,2026-11-22T10:00:00.252,5,1,9,0,\r\n";
    let read = entries(text);
    assert_eq!(
        read.iter().map(gist).collect::<Vec<_>>(),
        [
            (None, 0b100, 0b100, 0b100),
            (None, 0b1000, 0b1100, 0b1100),
            (Some(9), 0b1_0000, 0b1_0000, 0b1_0000),
        ]
    );
    assert_eq!(read[0].life, Life::UNKNOWN);
    let more = format!("{}\n{}", HEADER.trim_end().to_owned() + ",colour", row(1, 1, 1));
    assert_eq!(
        entries(&more.replace(",0,\n", ",0,,red\n")).len(),
        1,
        "a column of a later version"
    );
}

#[test]
fn an_entry_that_was_read_twice_comes_twice() {
    let text = HEADER.to_owned() + &row(1, 3, 1) + &row(1, 3, 1);
    assert_eq!(entries(&text).len(), 2);
}

#[test]
fn an_entry_without_changes_is_an_entry() {
    let text = format!(
        "{HEADER}1,2026-13-22T10:00:00.250,,,1,0,\"month 13 is out of range; no input changed, on: 3\"\n"
    );
    let entries = entries(&text);
    assert_eq!(gist(&entries[0]), (Some(1), 0, 0, 0));
    assert_eq!(entries[0].entry.time.month, 13);
}

#[test]
fn a_damaged_row_is_named_and_those_around_it_are_read() {
    for (damaged, why) in [
        ("2,2026-11-22T10:00:00.250,3,1,12", "5 fields where 7 have to be"),
        ("2,2026-11-22T10:00:00.250,33,1,2,0,", "input cannot be `33`"),
        ("2,2026-11-22T10:00:00.250,3,,2,0,", "state cannot be ``"),
        ("2,2026-11-22T10:00:00.25,3,1,2,0,", "time cannot be `2026-11-22T10:00:00.25`"),
        ("70000,2026-11-22T10:00:00.250,3,1,2,0,", "entry cannot be `70000`"),
        ("2,2026-11-22T10:00:00.250,3,1,-2,0,", "sequence cannot be `-2`"),
        ("2,2026-11-22T10:00:00.250,3,1,2,AB,", "life cannot be `AB`"),
        ("2,2026-11-22T10:00:00.250,,,2,0,\"no input cha", "a quote is not closed"),
        (",,,,2,0,lost some", "this is not a loss: `lost some`"),
        ("entry,when,input,state", "this header has other columns"),
        (&",".repeat(100), "too many fields"),
    ] {
        let text = format!("{HEADER}{}{damaged}\n{}", row(1, 1, 1), row(3, 1, 0));
        let read = read(&text);
        let [Ok(_), Err(error), Ok(_)] = &read[..] else { panic!("{damaged}: {read:?}") };
        assert_eq!(error.line, 3);
        assert!(error.to_string().contains(why), "{damaged}: {error}");
    }
}

#[test]
fn rows_before_a_header_are_none_of_ours() {
    let mut reader = Reader::new("1,2026-11-22T10:00:00.250,3,1\n".as_bytes(), "U1");
    let error = reader.next().expect("an item").expect_err("an error");
    assert_eq!(error.to_string(), "line 1: there is no header before this row");
}

#[test]
fn a_format_is_known_by_its_content() {
    let jsonl = r#"{"entry":1,"time":"2026-11-22T10:00:00.250","changed":[],"state":[]}"#;
    let csv = HEADER.to_owned() + &row(1, 1, 1);
    for text in [jsonl, &format!("\n\n {jsonl}"), &csv, &format!("\u{FEFF}{csv}")] {
        let read = read(text);
        assert!(matches!(&read[..], [Ok(_)]), "{text}: {read:?}");
    }
    for nothing in ["", "\n\n"] {
        assert!(read(nothing).is_empty());
    }
    for strange in ["MZ\u{0}", "time,entry", "<html>"] {
        let error = Source::new(strange.as_bytes(), "U1").err().expect("none of ours");
        assert!(matches!(error.problem, Problem::NotOurs), "{error}");
    }
}

proptest! {
    #[test]
    fn nothing_that_is_in_a_file_is_too_much(
        lines in proptest::collection::vec("[0-9,\"a-z:T\n-]{0,60}", 0..20),
    ) {
        let text = HEADER.to_owned() + &lines.concat();
        read(&text).into_iter().for_each(drop);
    }
}
