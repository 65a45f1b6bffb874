//! JSON lines: one object per event, and one per loss.

use std::io::{self, Write};

use ser_client::Lost;
use ser_proto::Inputs;
use serde::Serialize;

use super::{EventWriter, Loss};

/// Writes lines like
/// `{"entry":17,"time":"2026-11-22T10:00:00.250","changed":[3,17],"state":[3],"sequence":120,
/// "life":"9f3c5a7e21b04d68"}` and `{"lost":37,"count":"exactly","after":120,"why":"overwritten",
/// "life":"9f3c5a7e21b04d68"}`.
pub(crate) struct JsonLines<W> {
    out: W,
}

#[derive(Serialize)]
struct EventLine {
    /// The recorder's number for it.
    entry: u16,
    /// In the recorder's own time, as it was read.
    time: String,
    /// Numbers of the inputs that changed.
    changed: Vec<u8>,
    /// Numbers of the inputs that are on from now.
    state: Vec<u8>,
    /// The total after it in the life of its log; `null` if that is not known.
    sequence: Option<u64>,
    /// The life of its log; `0` if that is not known.
    life: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
}

#[derive(Serialize)]
struct LossLine {
    /// How many events; `null` if that is not known.
    lost: Option<u32>,
    /// `exactly`, `at least` or `unknown`.
    count: &'static str,
    /// The sequence of the last event before the loss.
    after: Option<u64>,
    /// `overwritten`, `log began anew` or `not recorded`.
    why: &'static str,
    /// The inputs that changed without being recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    inputs: Option<Vec<u8>>,
    /// The life of the last event before the loss.
    life: String,
}

impl<W: Write> JsonLines<W> {
    pub(crate) fn new(out: W) -> JsonLines<W> {
        JsonLines { out }
    }

    fn line(&mut self, line: &impl Serialize) -> io::Result<()> {
        serde_json::to_writer(&mut self.out, line)?;
        writeln!(self.out)
    }
}

fn numbers(inputs: Inputs) -> Vec<u8> {
    inputs.numbers().collect()
}

impl<W: Write> EventWriter for JsonLines<W> {
    fn event(&mut self, event: &super::Event) -> io::Result<()> {
        self.line(&EventLine {
            entry: event.number,
            time: event.entry.time.to_string(),
            changed: numbers(event.entry.changed),
            state: numbers(event.entry.state),
            sequence: event.sequence,
            life: event.life.to_string(),
            note: event.note(),
        })
    }

    fn lost(&mut self, loss: &Loss) -> io::Result<()> {
        let (lost, count) = loss.count();
        let inputs = match loss.lost {
            Lost::Unrecorded { inputs } => Some(numbers(inputs)),
            _ => None,
        };
        let (after, why, life) = (loss.after, loss.why(), loss.life.to_string());
        self.line(&LossLine { lost, count, after, why, inputs, life })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::testing::{entry, event, four_lost, odd};

    #[test]
    fn every_event_is_a_line_and_every_loss() {
        let mut out = Vec::new();
        let mut lines = JsonLines::new(&mut out);
        lines.event(&event(2048, entry("00.250", &[3, 17], &[1, 3]))).unwrap();
        lines.lost(&four_lost()).unwrap();
        let inputs = Inputs(0b101);
        lines.lost(&Loss { lost: Lost::Unrecorded { inputs }, ..four_lost() }).unwrap();
        lines.event(&odd(event(1, entry("00.251", &[], &[])))).unwrap();
        let life = "\"life\":\"00000000000000ab\"";
        assert_eq!(
            String::from_utf8(out).unwrap().lines().collect::<Vec<_>>(),
            [
                format!(
                    "{{\"entry\":2048,\"time\":\"2026-11-22T10:00:00.250\",\"changed\":[3,17],\"state\":[1,3],\
                     \"sequence\":5000,{life}}}"
                ),
                format!(
                    "{{\"lost\":4,\"count\":\"exactly\",\"after\":4996,\"why\":\"overwritten\",{life}}}"
                ),
                format!(
                    "{{\"lost\":null,\"count\":\"unknown\",\"after\":4996,\"why\":\"not recorded\",\
                     \"inputs\":[1,3],{life}}}"
                ),
                format!(
                    "{{\"entry\":1,\"time\":\"2026-11-22T10:00:00.251\",\"changed\":[],\"state\":[],\
                     \"sequence\":5000,{life},\"note\":\"month 13 is out of range; the clock \
                     went back\"}}"
                ),
            ]
        );
    }
}
