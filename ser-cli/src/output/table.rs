//! A table for people: what changed, when, and how long after the previous and after the first
//! event.

use std::io::{self, Write};

use ser_proto::Entry;

use super::{Elapsed, Event, EventWriter, Loss, Palette, Points};

/// Wide enough for a time of less than an hour, and for the shorter text of a longer one.
const WIDTH: usize = "+59m59.999 s".len();

/// Writes lines like `17  2026-11-22T10:00:00.250  +0.012 s  +1.204 s  3 ON  17 OFF`.
pub(crate) struct Table<W> {
    out: W,
    palette: Palette,
    points: Points,
    header_due: bool,
    elapsed: Elapsed,
}

impl<W: Write> Table<W> {
    /// `has_header` says whether the header is already there.
    pub(crate) fn new(out: W, palette: Palette, has_header: bool) -> Table<W> {
        let (points, elapsed) = (Points::default(), Elapsed::default());
        Table { out, palette, points, header_due: !has_header, elapsed }
    }

    fn header(&mut self) -> io::Result<()> {
        if !std::mem::take(&mut self.header_due) {
            return Ok(());
        }
        let title = self.palette.title;
        writeln!(self.out, "{title}{}{title:#}", header())
    }

    fn changes(&mut self, entry: &Entry) -> io::Result<()> {
        let on = self.palette.on;
        for (position, input) in entry.changed.numbers().enumerate() {
            let gap = if position == 0 { "" } else { "  " };
            let is_on = entry.state.contains(input);
            let change = self.points.state(input, is_on);
            match is_on {
                true => write!(self.out, "{gap}{on}{change}{on:#}")?,
                false => write!(self.out, "{gap}{change}")?,
            }
        }
        Ok(())
    }
}

/// The titles of the columns.
pub(super) fn header() -> String {
    let (time, previous, first) = ("time", "Δ previous", "Δ first");
    format!("entry  {time:<23}  {previous:>WIDTH$}  {first:>WIDTH$}  changes")
}

impl<W: Write> EventWriter for Table<W> {
    fn event(&mut self, event: &Event) -> io::Result<()> {
        let Event { number, entry, .. } = event;
        self.header()?;
        let [previous, first] = self.elapsed.at(entry.time);
        write!(
            self.out,
            "{number:>5}  {:<23}  {previous:>WIDTH$}  {first:>WIDTH$}  ",
            entry.time.to_string()
        )?;
        self.changes(entry)?;
        let alarm = self.palette.alarm;
        match event.note() {
            Some(note) if entry.changed.is_empty() => {
                writeln!(self.out, "{alarm}({note}){alarm:#}")
            }
            Some(note) => writeln!(self.out, "  {alarm}({note}){alarm:#}"),
            None => writeln!(self.out),
        }
    }

    fn lost(&mut self, loss: &Loss) -> io::Result<()> {
        self.header()?;
        let alarm = self.palette.alarm;
        writeln!(self.out, "{alarm}    -  {}{alarm:#}", loss.sentence())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    fn name_points(&mut self, points: Points) {
        self.points = points;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost, odd, points};

    fn written(write: impl FnOnce(&mut Table<&mut Vec<u8>>) -> io::Result<()>) -> String {
        let mut out = Vec::new();
        write(&mut Table::new(&mut out, Palette::plain(), false)).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_line_tells_what_changed_and_when() {
        let text = written(|table| {
            table.event(&event(9, entry("00.250", &[3, 17], &[3])))?;
            table.event(&event(10, entry("00.262", &[17], &[3, 17])))?;
            table.lost(&four_lost())?;
            table.event(&event(2048, entry("59.250", &[3], &[17])))
        });
        assert_eq!(
            text.lines().collect::<Vec<_>>(),
            [
                "entry  time                       Δ previous       Δ first  changes",
                "    9  2026-11-22T10:00:00.250                              3 ON  17 OFF",
                "   10  2026-11-22T10:00:00.262      +0.012 s      +0.012 s  17 ON",
                "    -  4 events were overwritten before they were read",
                " 2048  2026-11-22T10:00:59.250     +58.988 s     +59.000 s  3 OFF",
            ]
        );
    }

    #[test]
    fn inputs_with_a_point_have_its_name_and_texts() {
        let text = written(|table| {
            table.name_points(points());
            table.event(&event(9, entry("00.250", &[3, 17], &[17])))?;
            table.event(&event(10, entry("00.262", &[3], &[3, 17])))
        });
        let changes = |line: &str| line.chars().skip(60).collect::<String>();
        assert_eq!(
            text.lines().map(changes).collect::<Vec<_>>(),
            ["changes", "52-1 closed OPEN  17 ON", "52-1 closed CLOSED"]
        );
    }

    #[test]
    fn nothing_is_written_without_events() {
        assert_eq!(written(|table| table.flush()), "");
    }

    #[test]
    fn an_impossible_date_has_no_delta_and_an_event_may_be_empty() {
        let mut never = entry("00.000", &[], &[]);
        never.time.month = 13;
        let text = written(|table| {
            table.event(&event(1, entry("00.000", &[1], &[1])))?;
            table.event(&odd(event(2, never)))?;
            table.event(&odd(event(3, entry("00.000", &[1], &[1]))))
        });
        assert_eq!(
            text.lines().skip(2).collect::<Vec<_>>(),
            [
                "    2  2026-13-22T10:00:00.000             ?             ?  (month 13 is out of \
                 range; the clock went back)",
                "    3  2026-11-22T10:00:00.000             ?      +0.000 s  1 ON  (month 13 is \
                 out of range; the clock went back)",
            ]
        );
    }

    #[test]
    fn colours_come_from_the_palette_only() {
        assert!(!written(|table| table.lost(&four_lost())).contains('\x1B'));
    }
}
