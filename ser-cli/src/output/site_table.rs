//! The events of several recorders in one table.

use std::io::{self, Write};

use ser_console::Harmless;
use unicode_width::UnicodeWidthStr;

use super::{Event, Loss, Palette, Points, Record};

/// What the table needs to know of a recorder.
#[derive(Clone, Debug)]
pub(crate) struct RecorderColumn {
    pub(crate) name: String,
    pub(crate) points: Points,
}

/// What is known of the order of a row and the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowOrder {
    /// The row before came first, or both at once.
    AsShown,
    /// Nobody knows.
    Unknown,
    /// This row came first: its recorder was read later.
    Earlier,
}

/// What is said of a row that came before the one above it.
const EARLIER: &str = "earlier than the row above";

/// Writes lines like `  U1-SER1     17  2026-11-22T10:00:00.250  52-1 closed OPEN`, with a `~` in
/// front where this row is not known to have come after the one before.
pub(crate) struct SiteTable<W> {
    out: W,
    palette: Palette,
    recorders: Vec<RecorderColumn>,
    width: usize,
    header_due: bool,
}

impl<W: Write> SiteTable<W> {
    /// `has_header` says whether the header is already there.
    pub(crate) fn new(
        out: W,
        palette: Palette,
        recorders: Vec<RecorderColumn>,
        has_header: bool,
    ) -> SiteTable<W> {
        let width = width(&recorders);
        SiteTable { out, palette, recorders, width, header_due: !has_header }
    }

    /// Writes what happened in the log of a recorder, named by its place in the list.
    pub(crate) fn record(
        &mut self,
        recorder: usize,
        record: &Record,
        order: RowOrder,
    ) -> io::Result<()> {
        if std::mem::take(&mut self.header_due) {
            let title = self.palette.title;
            writeln!(self.out, "{title}{}{title:#}", header(&self.recorders))?;
        }
        let Some(RecorderColumn { name, points }) = self.recorders.get(recorder) else {
            return Ok(());
        };
        let name = Harmless(name).line();
        let blanks = self.width.saturating_sub(name.width());
        let (alarm, mark) =
            (self.palette.alarm, if order == RowOrder::AsShown { " " } else { "~" });
        write!(self.out, "{alarm}{mark}{alarm:#} {name}{:blanks$}  ", "")?;
        match record {
            Record::Event(event) => event_cells(&mut self.out, self.palette, points, event, order),
            Record::Loss(loss) => loss_cells(&mut self.out, self.palette, loss),
        }
    }

    /// Passes on what has been written so far.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// The titles of the columns.
pub(crate) fn header(recorders: &[RecorderColumn]) -> String {
    let width = width(recorders);
    format!("  {:<width$}  entry  {:<23}  changes", "recorder", "time")
}

fn width(recorders: &[RecorderColumn]) -> usize {
    let widths = recorders.iter().map(|recorder| Harmless(&recorder.name).line().width());
    widths.max().unwrap_or(0).max("recorder".len())
}

fn event_cells(
    out: &mut dyn Write,
    palette: Palette,
    points: &Points,
    event: &Event,
    order: RowOrder,
) -> io::Result<()> {
    let (on, alarm) = (palette.on, palette.alarm);
    write!(out, "{:>5}  {:<23}", event.number, event.entry.time.to_string())?;
    for input in event.entry.changed.numbers() {
        let is_on = event.entry.state.contains(input);
        let change = points.state(input, is_on);
        match is_on {
            true => write!(out, "  {on}{change}{on:#}")?,
            false => write!(out, "  {change}")?,
        }
    }
    let earlier = (order == RowOrder::Earlier).then(|| EARLIER.to_owned());
    for note in event.note().into_iter().chain(earlier) {
        write!(out, "  {alarm}({note}){alarm:#}")?;
    }
    writeln!(out)
}

fn loss_cells(out: &mut dyn Write, palette: Palette, loss: &Loss) -> io::Result<()> {
    let alarm = palette.alarm;
    writeln!(out, "{alarm}    -  {}{alarm:#}", loss.sentence())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost, points};

    #[test]
    fn each_row_names_its_recorder() {
        let recorders = vec![
            RecorderColumn { name: "U1-SER1".to_owned(), points: points() },
            RecorderColumn { name: "遮断器 記録 2".to_owned(), points: Points::default() },
        ];
        let mut out = Vec::new();
        let mut table = SiteTable::new(&mut out, Palette::plain(), recorders, false);
        let first = event(9, entry("00.250", &[3, 17], &[17]));
        let second = Record::Event(event(2048, entry("00.262", &[3], &[3])));
        let late = Record::Event(event(10, entry("00.251", &[17], &[])));
        table.record(0, &Record::Event(first), RowOrder::AsShown).unwrap();
        table.record(1, &second, RowOrder::Unknown).unwrap();
        table.record(0, &late, RowOrder::Earlier).unwrap();
        table.record(0, &Record::Loss(four_lost()), RowOrder::AsShown).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap().lines().collect::<Vec<_>>(),
            [
                "  recorder       entry  time                     changes",
                "  U1-SER1            9  2026-11-22T10:00:00.250  52-1 closed OPEN  17 ON",
                "~ 遮断器 記録 2   2048  2026-11-22T10:00:00.262  3 ON",
                "~ U1-SER1           10  2026-11-22T10:00:00.251  17 OFF  \
                 (earlier than the row above)",
                "  U1-SER1            -  4 events were overwritten before they were read",
            ]
        );
    }
}
