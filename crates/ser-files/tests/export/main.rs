//! Exports, held against the entries that they are made from. That other programs read them is
//! tested where these programs are run, in `ser-cli`.

#[path = "../../../ser-evidence/tests/common/mod.rs"]
mod common;
mod comtrade;
mod lossless;
#[cfg(feature = "parquet")]
mod parquet;
mod part;
mod prc002;
mod unknown_states;
mod vcd;
mod writing;

use common::{Log, history};
use ser_evidence::incident::{Incident, Which};
use ser_evidence::site::Site;
use ser_evidence::time::Moment;
use ser_evidence::timeline::Timeline;
use ser_files::export::{Counted, Origin, Refused, Selection};

/// Nothing is known of where it comes from.
const NOWHERE: Origin<'static> =
    Origin { program: "test 1.0", site_digest: None, not_reached: &[], damaged_lines: 0 };

/// What a writer writes of these logs.
fn exported(
    site: &Site,
    logs: &[&Log],
    write: impl FnOnce(&mut Vec<u8>, &Timeline<'_>, &Selection) -> Result<Counted, Refused>,
) -> (Vec<u8>, Counted) {
    let history = history(site, logs);
    let timeline = Timeline::new(site, &history);
    let mut out = Vec::new();
    let counted = write(&mut out, &timeline, &Selection::everything()).expect("a vector takes all");
    (out, counted)
}

/// The entries between two times.
fn between(timeline: &Timeline<'_>, since: &str, until: &str) -> Selection {
    let moment = |text| Moment::from_us(common::seen(text).us());
    let which = Which::Between(Some(moment(since)), Some(moment(until)));
    Selection::of(timeline, &Incident::pick(timeline, which).expect("some entries"))
}

/// A recorder on UTC, and its points: number and name.
fn recorder(name: &str, points: &[(u8, &str)]) -> String {
    let mut text = format!("[[recorder]]\nname = \"{name}\"\nclock = \"utc\"\n");
    for (input, point) in points {
        text += &format!("[[point]]\nrecorder = \"{name}\"\ninput = {input}\nname = \"{point}\"\n");
    }
    text
}
