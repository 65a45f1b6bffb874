//! What the report is made from.

use std::io::{self, Write};

use super::heading;
use crate::report::style::Styles;
use crate::report::table::{Align, Cell, Table};
use crate::report::{Clock, Document, sources, verdict};

pub(super) fn write(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    heading(out, "Made from", styles)?;
    let mut table = Table::new(vec![
        ("recorder", Align::Left),
        ("entries", Align::Right),
        ("complete", Align::Wrapped),
        ("clock", Align::Wrapped),
    ]);
    for source in sources::recorders(document, clock) {
        let alarm = if source.is_complete { anstyle::Style::new() } else { styles.alarm };
        table.row(vec![
            Cell::from(source.recorder),
            Cell::from(source.entries.to_string()),
            Cell::styled(source.complete, alarm),
            Cell::from(source.clock),
        ]);
    }
    table.write(out, styles.faint)?;
    let (alarm, faint) = (styles.alarm, styles.faint);
    for missed in sources::not_reached(document) {
        writeln!(out, "{alarm}not reached{alarm:#} {missed}")?;
    }
    if let Some(damaged) = verdict::damaged(document) {
        writeln!(out, "{alarm}damaged{alarm:#} {damaged}: what was in them is not known")?;
    }
    for changes in sources::left_out(document, clock) {
        writeln!(out, "{alarm}left out{alarm:#} {changes}")?;
    }
    for finding in sources::findings(document.timeline) {
        writeln!(out, "{alarm}clocks{alarm:#} {finding}")?;
    }
    for shift in sources::shifts(document.timeline, clock) {
        writeln!(out, "shifted by hand: {shift}")?;
    }
    writeln!(out, "{faint}{}{faint:#}", sources::entries(document))?;
    for head in sources::archive_heads(document) {
        writeln!(out, "{faint}{head}{faint:#}")?;
    }
    writeln!(out, "{faint}{}{faint:#}", sources::made_by(document))
}
