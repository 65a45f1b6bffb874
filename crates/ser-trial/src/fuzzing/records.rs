//! Files of records, JSON lines or CSV, as somebody hands them in for a report.

use std::io::BufReader;

use ser_evidence::record::Told;
use ser_files::Source;
use ser_files::jsonl::{Reader, Writer};

/// `data` is the content of the file. However it is cut into pieces, it holds the same. There is at
/// most one item for a line, apart from an entry that ends with it, and a record is the same after it
/// has been written down again.
///
/// # Panics
/// When this does not hold.
pub fn records(data: &[u8]) {
    let whole = Source::new(data, "U1").map(Iterator::collect::<Vec<_>>);
    let pieces =
        Source::new(BufReader::with_capacity(7, data), "U1").map(Iterator::collect::<Vec<_>>);
    assert_eq!(format!("{whole:?}"), format!("{pieces:?}"));
    let Ok(items) = whole else { return };
    let lines = data.split(|&byte| byte == b'\n').count();
    assert!(items.len() <= 2 * lines, "{} items in {lines} lines", items.len());
    let mut again = Vec::new();
    let told: Vec<Told> = items.into_iter().filter_map(Result::ok).collect();
    for Told { recorder, record } in &told {
        Writer::new(&mut again).record(recorder, record).expect("what was read can be written");
    }
    let read: Vec<Told> = Reader::new(&again[..], "U2").map(|told| told.expect("ours")).collect();
    assert_eq!(read, told);
}
