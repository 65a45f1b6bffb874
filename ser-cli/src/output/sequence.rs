//! The sequence of events of one incident, by the names of the inputs, with the event that started
//! it.

use std::collections::BTreeMap;
use std::io::{self, Write};

use ser_proto::{Entry, TimeStamp};

use super::{Elapsed, Event, EventWriter, Loss, Palette};

/// The names of the inputs.
pub(crate) type PointNames = BTreeMap<u8, String>;

/// An incident lasts seconds.
const WIDTH: usize = "+59.999 s".len();

/// The width of everything before the changes of an event, so that its second change goes below the
/// first.
const INDENT: usize = 5 + 1 + 12 + 2 + WIDTH + 1 + WIDTH + 2;

/// Writes lines like `2 10:00:00.262  +0.012 s  +0.012 s  17 ON  87T trip`, made to fit 80 columns:
/// no date, and one line per change.
pub(crate) struct Sequence<W> {
    out: W,
    palette: Palette,
    names: PointNames,
    header_due: bool,
    elapsed: Elapsed,
}

impl<W: Write> Sequence<W> {
    pub(crate) fn new(out: W, palette: Palette, names: PointNames) -> Sequence<W> {
        Sequence { out, palette, names, header_due: true, elapsed: Elapsed::default() }
    }

    fn header(&mut self) -> io::Result<()> {
        if !std::mem::take(&mut self.header_due) {
            return Ok(());
        }
        let title = self.palette.title;
        let (time, previous, first) = ("time", "Δ prev", "Δ first");
        writeln!(
            self.out,
            "{title}entry {time:<12}  {previous:>WIDTH$} {first:>WIDTH$}  input  point{title:#}"
        )
    }

    fn changes(&mut self, entry: &Entry) -> io::Result<()> {
        if entry.changed.is_empty() {
            return writeln!(self.out);
        }
        for (position, input) in entry.changed.numbers().enumerate() {
            let indent = if position == 0 { 0 } else { INDENT };
            let name = self.names.get(&input).map_or("", String::as_str);
            let (style, state) = match entry.state.contains(input) {
                true => (self.palette.on, "ON"),
                false => (anstyle::Style::new(), "OFF"),
            };
            let line = format!("{:indent$}{input:>2} {style}{state:<3} {name}{style:#}", "");
            writeln!(self.out, "{}", line.trim_end())?;
        }
        Ok(())
    }

    fn remark(&mut self, what: &str) -> io::Result<()> {
        let alarm = self.palette.alarm;
        writeln!(self.out, "{alarm}    - {what}{alarm:#}")
    }
}

impl<W: Write> EventWriter for Sequence<W> {
    fn event(&mut self, event: &Event) -> io::Result<()> {
        let Event { number, entry, .. } = event;
        self.header()?;
        let time = time_of_day(entry.time);
        match self.elapsed.at(entry.time) {
            [previous, first] if first.is_empty() => {
                let style = self.palette.first_out;
                let mark = "first-out";
                write!(
                    self.out,
                    "{number:>5} {time}  {previous:>WIDTH$} {style}{mark:>WIDTH$}{style:#}  "
                )?;
            }
            [previous, first] => {
                write!(self.out, "{number:>5} {time}  {previous:>WIDTH$} {first:>WIDTH$}  ")?;
            }
        }
        self.changes(entry)?;
        match event.note() {
            Some(note) => self.remark(&note),
            None => Ok(()),
        }
    }

    fn lost(&mut self, loss: &Loss) -> io::Result<()> {
        self.header()?;
        self.remark(&loss.sentence())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn time_of_day(time: TimeStamp) -> String {
    format!("{:02}:{:02}:{:02}.{:03}", time.hour, time.minute, time.second, time.millisecond)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost, odd};

    #[test]
    fn every_change_has_a_line_with_its_name_and_the_first_event_is_marked() {
        let mut out = Vec::new();
        let names =
            PointNames::from([(3, "52-1 closed".to_string()), (17, "87T trip".to_string())]);
        let mut sequence = Sequence::new(&mut out, Palette::plain(), names);
        sequence.event(&event(1, entry("00.250", &[17], &[3, 17]))).unwrap();
        sequence.event(&odd(event(2, entry("00.290", &[3, 4], &[4, 17])))).unwrap();
        sequence.lost(&four_lost()).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap().lines().collect::<Vec<_>>(),
            [
                "entry time             Δ prev   Δ first  input  point",
                "    1 10:00:00.250            first-out  17 ON  87T trip",
                "    2 10:00:00.290   +0.040 s  +0.040 s   3 OFF 52-1 closed",
                "                                          4 ON",
                "    - month 13 is out of range; the clock went back",
                "    - 4 events were overwritten before they were read",
            ]
        );
    }
}
