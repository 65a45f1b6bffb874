//! Comma separated values: one row per input that changed, and one per loss.

use std::fmt::Display;
use std::io::{self, Write};

use super::{Event, EventWriter, Loss};

pub(super) const HEADER: &str = "entry,time,input,state,sequence,life,note";

/// Writes rows like `17,2026-11-22T10:00:00.250,3,1,120,9f3c5a7e21b04d68,`. The header comes first,
/// even when no event follows. A loss has nothing in the first four columns.
pub(crate) struct Csv<W> {
    out: W,
    header_due: bool,
}

impl<W: Write> Csv<W> {
    /// `has_header` says whether the header is already there.
    pub(crate) fn new(out: W, has_header: bool) -> Csv<W> {
        Csv { out, header_due: !has_header }
    }

    fn header(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.header_due) { writeln!(self.out, "{HEADER}") } else { Ok(()) }
    }

    fn change(&mut self, event: &Event, change: impl Display, note: &str) -> io::Result<()> {
        let Event { number, sequence, life, entry, .. } = event;
        let (sequence, note) = (number_or_nothing(*sequence), quoted(note));
        writeln!(self.out, "{number},{},{change},{sequence},{life},{note}", entry.time)
    }
}

impl<W: Write> EventWriter for Csv<W> {
    fn event(&mut self, event: &Event) -> io::Result<()> {
        self.header()?;
        let note = event.note().unwrap_or_default();
        if event.entry.changed.is_empty() {
            // An odd event without changes still needs a row.
            self.change(event, ",", &note)?;
        }
        for input in event.entry.changed.numbers() {
            let state = u8::from(event.entry.state.contains(input));
            self.change(event, format_args!("{input},{state}"), &note)?;
        }
        Ok(())
    }

    fn lost(&mut self, loss: &Loss) -> io::Result<()> {
        self.header()?;
        let after = number_or_nothing(loss.after);
        writeln!(self.out, ",,,,{after},{},{}", loss.life, quoted(&loss.to_string()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.header()?;
        self.out.flush()
    }
}

fn number_or_nothing(number: Option<u64>) -> String {
    number.map_or(String::new(), |number| number.to_string())
}

/// A note as one field.
fn quoted(note: &str) -> String {
    if note.contains([',', '"']) {
        format!("\"{}\"", note.replace('"', "\"\""))
    } else {
        note.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost, odd};

    #[test]
    fn every_change_has_a_row_of_its_own_and_so_has_a_loss() {
        let mut out = Vec::new();
        let mut csv = Csv::new(&mut out, false);
        csv.event(&event(2048, entry("00.250", &[3, 17], &[1, 3]))).unwrap();
        csv.lost(&four_lost()).unwrap();
        csv.event(&odd(event(1, entry("00.251", &[32], &[1, 3, 32])))).unwrap();
        csv.event(&Event { sequence: None, ..event(2, entry("00.252", &[], &[1])) }).unwrap();
        csv.flush().unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap().lines().collect::<Vec<_>>(),
            [
                "entry,time,input,state,sequence,life,note",
                "2048,2026-11-22T10:00:00.250,3,1,5000,00000000000000ab,",
                "2048,2026-11-22T10:00:00.250,17,0,5000,00000000000000ab,",
                ",,,,4996,00000000000000ab,lost 4 (exactly) after 4996: overwritten",
                "1,2026-11-22T10:00:00.251,32,1,5000,00000000000000ab,month 13 is out of range; \
                 the clock went back",
                "2,2026-11-22T10:00:00.252,,,,00000000000000ab,",
            ]
        );
    }

    #[test]
    fn a_note_with_a_comma_is_one_field() {
        assert_eq!(quoted("no input changed, on: 3"), "\"no input changed, on: 3\"");
        assert_eq!(quoted("a \"quote\""), "\"a \"\"quote\"\"\"");
    }

    #[test]
    fn the_header_comes_also_without_events_and_only_once() {
        let written = |has_header| {
            let mut out = Vec::new();
            let mut csv = Csv::new(&mut out, has_header);
            csv.flush().unwrap();
            csv.flush().unwrap();
            String::from_utf8(out).unwrap()
        };
        assert_eq!(written(false), "entry,time,input,state,sequence,life,note\n");
        assert_eq!(written(true), "");
    }
}
