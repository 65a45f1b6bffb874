//! The table for PRC-002.

use ser_evidence::history::Collector;
use ser_evidence::record::{Gap, Record};
use ser_evidence::timeline::Timeline;
use ser_files::export::{Selection, write_prc002, write_vcd};

use crate::common::{Log, site};
use crate::{NOWHERE, exported, recorder};

#[test]
fn times_are_those_of_the_site_also_when_summer_time_ends() {
    let point = "on = \"CLOSED\"\noff = \"OPEN\"\n";
    let site = site(&(recorder("U1", &[(1, "52-1, main")]) + point));
    let mut log = Log::of("U1", 1);
    log.changes("2026-10-25T00:59:59.990", &[1])
        .loses(2)
        .tells_overwritten(1, 2)
        .changes("2026-10-25T01:00:00.010", &[1]);
    let (out, _) = exported(&site, &[&log], |out, timeline, selection| {
        write_prc002(out, timeline, selection, false)
    });
    let expected = [
        "Date, Time, Local Time Code, Substation, Device, State",
        "10/25/2026,02:59:59.990,2,Northfield,\"52-1, main\",CLOSED",
        "10/25/2026,02:00:00.010,1,Northfield,U1,RECORDS MISSING: 2 entries missing (overwritten)",
        "10/25/2026,02:00:00.010,1,Northfield,\"52-1, main\",OPEN",
        "",
    ];
    assert_eq!(String::from_utf8(out).expect("UTF-8"), expected.join("\r\n"));
}

#[test]
fn a_recorder_that_nobody_could_read_has_a_row() {
    let site = site(&(recorder("U1", &[]) + &recorder("U2", &[])));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]);
    let mut collector = Collector::new();
    log.records().iter().for_each(|record| collector.add("U1", record));
    collector.add("U2", &Record::Gap(Gap::NOT_REACHED));
    let history = collector.finish(&site);
    let timeline = Timeline::new(&site, &history);
    let mut out = Vec::new();
    write_prc002(&mut out, &timeline, &Selection::everything(), false).expect("written");
    let text = String::from_utf8(out).expect("UTF-8");
    let row = "Northfield,U2,RECORDS MISSING: the recorder could not be reached\r\n";
    assert!(text.ends_with(row), "{text}");
    let mut vcd = Vec::new();
    write_vcd(&mut vcd, &timeline, &Selection::everything(), &NOWHERE).expect("written");
    let vcd = String::from_utf8(vcd).expect("UTF-8");
    assert!(vcd.contains("NOT READ: U2 could not be reached"), "{vcd}");
}
