//! JSON lines: everything, for another `ser-cli` and for scripts.

use std::io::Write;

use ser_evidence::record::Place;
use ser_evidence::timeline::Timeline;

use super::anchors::Anchors;
use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use crate::merged;

/// Writes a selection, and all that is known of lives and clocks.
///
/// # Errors
/// If `out` does not take it.
pub fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    program: &str,
) -> Result<Counted, Refused> {
    let mut counted = Counted::default();
    let anchors = Anchors::of(timeline, selection);
    let place = |recorder: usize, observation: Option<usize>, place: &Place| {
        anchors.in_part(timeline, (recorder, observation), place)
    };
    let items = selection.items(timeline).inspect(|item| counted.count(*item));
    merged::write_jsonl_items(out, timeline, (&place, items), program)?;
    Ok(counted)
}
