//! Comma separated values: one row per input that changed.

use std::io::{self, Write};

use ser_proto::Entry;

use super::EventWriter;

const HEADER: &str = "entry,time,input,state";

/// Writes rows like `17,2026-11-22T10:00:00.250,3,1`. The header comes first, also when no event follows.
pub(crate) struct Csv<W> {
    out: W,
    header_due: bool,
}

impl<W: Write> Csv<W> {
    pub(crate) fn new(out: W) -> Csv<W> {
        Csv { out, header_due: true }
    }

    fn header(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.header_due) { writeln!(self.out, "{HEADER}") } else { Ok(()) }
    }
}

impl<W: Write> EventWriter for Csv<W> {
    fn event(&mut self, number: u16, entry: &Entry) -> io::Result<()> {
        self.header()?;
        for input in entry.changed.numbers() {
            let state = u8::from(entry.state.contains(input));
            writeln!(self.out, "{number},{},{input},{state}", entry.time)?;
        }
        Ok(())
    }

    fn lost(&mut self, _what: &str) -> io::Result<()> {
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.header()?;
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    #[test]
    fn every_change_has_a_row_of_its_own() {
        let mut out = Vec::new();
        let mut csv = Csv::new(&mut out);
        csv.event(2048, &entry("00.250", &[3, 17], &[1, 3])).unwrap();
        csv.lost("3 events").unwrap();
        csv.event(1, &entry("00.251", &[32], &[1, 3, 32])).unwrap();
        csv.flush().unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "entry,time,input,state\n\
             2048,2026-11-22T10:00:00.250,3,1\n\
             2048,2026-11-22T10:00:00.250,17,0\n\
             1,2026-11-22T10:00:00.251,32,1\n"
        );
    }

    #[test]
    fn the_header_comes_also_without_events_and_only_once() {
        let mut out = Vec::new();
        let mut csv = Csv::new(&mut out);
        csv.flush().unwrap();
        csv.flush().unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "entry,time,input,state\n");
    }
}
