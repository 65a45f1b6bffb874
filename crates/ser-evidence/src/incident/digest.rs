//! A digest of the entries that a report is made from, so that anybody can check that it was these.

use std::fmt::Write;

use sha2::{Digest, Sha256};

use super::pick::Incident;
use crate::timeline::Timeline;

/// SHA-256 of one line for each entry, in the order of the timeline: recorder, life, sequence,
/// stamp, changed inputs and state (both as eight hexadecimal digits), separated by tabs.
pub(super) fn of(timeline: &Timeline<'_>, incident: &Incident) -> [u8; 32] {
    let mut sha = Sha256::new();
    let mut line = String::new();
    for &event in &incident.events {
        let (Some(recorder), Some(life), Some(held)) =
            (timeline.recorder(event), timeline.life(event), timeline.held(event))
        else {
            continue;
        };
        line.clear();
        let entry = held.entry;
        // Writing to a string does not fail.
        let _ = writeln!(
            line,
            "{}\t{}\t{}\t{}\t{:08x}\t{:08x}",
            recorder.recorder.name,
            life.name(),
            held.sequence,
            entry.time,
            entry.changed.0,
            entry.state.0
        );
        sha.update(line.as_bytes());
    }
    sha.finalize().into()
}
