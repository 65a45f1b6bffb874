//! Parquet, read again by the library that writes it.

use std::fs::{self, File};
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;
use ser_evidence::history::Collector;
use ser_evidence::record::{Gap, Record};
use ser_evidence::timeline::Timeline;
use ser_files::export::{Selection, write_parquet};

use crate::common::{Log, site};
use crate::{NOWHERE, recorder};

#[test]
fn a_recorder_that_was_not_reached_has_a_row() {
    let site = site(&(recorder("U1", &[(1, "a")]) + &recorder("U2", &[])));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]);
    let mut collector = Collector::new();
    for record in log.records() {
        collector.add("U1", record);
    }
    collector.add("U2", &Record::Gap(Gap::NOT_REACHED));
    let history = collector.finish(&site);
    let timeline = Timeline::new(&site, &history);
    let mut out = Vec::new();
    write_parquet(&mut out, &timeline, &Selection::everything(), &NOWHERE).expect("written");

    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("not-reached.parquet");
    fs::write(&path, out).expect("a file");
    let file = SerializedFileReader::new(File::open(&path).expect("a file")).expect("Parquet");
    let rows = file.get_row_iter(None).expect("rows").map(|row| row.expect("a row"));
    let texts: Vec<[String; 4]> = rows
        .map(|row| {
            // Kind, recorder, life, and the last column: why something is missing.
            [0, 1, 2, row.len() - 1]
                .map(|column| row.get_string(column).map_or("-", String::as_str).to_owned())
        })
        .collect();
    let life = "0000000000000001";
    assert_eq!(texts, [["change", "U1", life, "-"], ["loss", "U2", "", "not reached"]]);
}
