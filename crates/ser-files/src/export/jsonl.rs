//! JSON lines: everything, for another `ser-cli` and for scripts.

use std::io::Write;

use ser_evidence::timeline::Timeline;

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
    let items = selection.items(timeline).inspect(|item| counted.count(*item));
    merged::write_jsonl_items(out, timeline, items, program)?;
    Ok(counted)
}
