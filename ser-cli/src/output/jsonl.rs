//! JSON lines: one object per event.

use std::io::{self, Write};

use ser_proto::{Entry, Inputs};
use serde::Serialize;

use super::EventWriter;

/// Writes lines like `{"entry":17,"time":"2026-11-22T10:00:00.250","changed":[3,17],"state":[3]}`.
pub(crate) struct JsonLines<W> {
    out: W,
}

#[derive(Serialize)]
struct Event {
    /// The number under which the unit has it.
    entry: u16,
    /// In the unit's local time.
    time: String,
    /// Numbers of the inputs that changed.
    changed: Vec<u8>,
    /// Numbers of the inputs that are on from now.
    state: Vec<u8>,
}

impl<W: Write> JsonLines<W> {
    pub(crate) fn new(out: W) -> JsonLines<W> {
        JsonLines { out }
    }
}

impl<W: Write> EventWriter for JsonLines<W> {
    fn event(&mut self, number: u16, entry: &Entry) -> io::Result<()> {
        let numbers = |inputs: Inputs| inputs.numbers().collect();
        let event = Event {
            entry: number,
            time: entry.time.to_string(),
            changed: numbers(entry.changed),
            state: numbers(entry.state),
        };
        serde_json::to_writer(&mut self.out, &event)?;
        writeln!(self.out)
    }

    fn lost(&mut self, _what: &str) -> io::Result<()> {
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::entry;

    #[test]
    fn every_event_is_a_line() {
        let mut out = Vec::new();
        let mut lines = JsonLines::new(&mut out);
        lines.event(2048, &entry("00.250", &[3, 17], &[1, 3])).unwrap();
        lines.lost("3 events").unwrap();
        lines.event(1, &entry("00.251", &[1], &[])).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "{\"entry\":2048,\"time\":\"2026-11-22T10:00:00.250\",\"changed\":[3,17],\"state\":[1,3]}\n\
             {\"entry\":1,\"time\":\"2026-11-22T10:00:00.251\",\"changed\":[1],\"state\":[]}\n"
        );
    }
}
