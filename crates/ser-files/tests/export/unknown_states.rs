//! Inputs that changed, and no source says to what.

use ser_evidence::record::{Record, Told};
use ser_evidence::timeline::Timeline;
use ser_files::Source;
use ser_files::export::{Selection, write_csv, write_prc002};
use ser_files::merged::{CsvStyle, write_csv as merge_csv, write_table};
use ser_files::report::Styles;

use crate::common::{Log, history, site};
use crate::recorder;

#[test]
fn a_state_that_nobody_knows_is_in_no_table_said_to_be_off() {
    let point = "on = \"CLOSED\"\noff = \"OPEN\"\nnormal = \"on\"\n";
    let site = site(&(recorder("U1", &[(1, "52a")]) + point));
    let mut log = Log::of("U1", 1);
    log.changes("2026-11-22T10:00:00.250", &[1]).moves("2026-11-22T10:00:00.270", &[1]);
    let history = history(&site, &[&log]);
    let timeline = Timeline::new(&site, &history);
    let all = Selection::everything();
    let text = |write: &dyn Fn(&mut Vec<u8>)| {
        let mut out = Vec::new();
        write(&mut out);
        let text = String::from_utf8(out).expect("UTF-8");
        let last = text.lines().last().expect("a line").to_owned();
        (text, last)
    };

    let (_, last) = text(&|out| _ = write_prc002(out, &timeline, &all, false).expect("written"));
    assert!(last.ends_with(",52a,state not known"), "{last}");
    let (_, last) = text(&|out| write_table(out, &timeline, Styles::default()).expect("written"));
    assert!(last.ends_with(" 52a state not known"), "{last}");
    let named = CsvStyle { has_names: true, ..CsvStyle::default() };
    let (_, last) = text(&|out| _ = write_csv(out, &timeline, &all, named).expect("written"));
    assert!(last.ends_with(",52a,state not known"), "{last}");
    let (csv, last) = text(&|out| merge_csv(out, &timeline).expect("written"));
    assert!(last.starts_with("2,2026-11-22T10:00:00.270,1,?,2,"), "{last}");

    // It is read as what it is.
    let states = |(told, wanted): (Result<Told, _>, u32)| match told.expect("a record").record {
        Record::Entry(entry) => assert_eq!((entry.known.0, entry.entry.state.0), (wanted, wanted)),
        other => panic!("{other:?}"),
    };
    let told = Source::new(csv.as_bytes(), "U1").expect("a file of ours");
    told.zip([1, 0]).for_each(states);
}
