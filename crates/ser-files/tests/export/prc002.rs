//! The table for PRC-002.

use ser_files::export::write_prc002;

use crate::common::{Log, site};
use crate::{exported, recorder};

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
