//! CSV for spreadsheets and other programs: the rows of a merged list, in the dialect that is wanted.

use std::io::Write;

use ser_evidence::timeline::Timeline;

use super::counted::Counted;
use super::refused::Refused;
use super::selection::Selection;
use crate::merged::{self, CsvStyle};

/// Writes a selection. Entries without a time are in it.
///
/// # Errors
/// If `out` does not take it.
pub fn write(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    selection: &Selection,
    style: CsvStyle,
) -> Result<Counted, Refused> {
    let mut counted = Counted::default();
    let items = selection.items(timeline).inspect(|item| counted.count(*item));
    merged::write_csv_items(out, timeline, items, style)?;
    Ok(counted)
}
