//! A full log is read at nearly the rate of the line, in virtual time. `cargo bench --bench
//! download` prints the table.

use ser_client::LogPosition;
use ser_proto::{Baud, Model};
use ser_trial::download::Download;

fn reads_at_line_rate(model: Model) {
    for baud in Baud::ALL {
        let download = Download::run(model, baud, false);
        let summary = download.summary;
        assert_eq!((summary.delivered, summary.lost), (2048, 3000 - 2048), "{baud:?}");
        assert_eq!(summary.position, LogPosition { total: 3000, next_slot: 3000 - 2048 });
        // One event in each millisecond.
        let stamps = download.entries.iter().map(|entry| u32::from(entry.time.millisecond));
        let first = download.entries.first().map_or(0, |entry| u32::from(entry.time.millisecond));
        assert!(stamps.eq((first..).take(2048).map(|ms| ms % 1000)), "{baud:?}: another order");
        assert!(download.took >= download.least, "{baud:?}: faster than the line");
        assert!(download.percent() >= 95.0, "{baud:?}: {:.1} %", download.percent());
    }
}

#[test]
fn a_full_ser160_log_is_read_at_line_rate() {
    reads_at_line_rate(Model::Ser160);
}

#[test]
fn a_full_ser320_log_is_read_at_line_rate() {
    reads_at_line_rate(Model::Ser320);
}
