//! JSON lines: one object per record.

use std::io::{self, Write};

use ser_evidence::record::{EntryRecord, Gap, Record};
use ser_files::jsonl::Writer;

use super::{EventWriter, Loss, Rows};

/// How this program calls itself in files.
pub(crate) const PROGRAM: &str = concat!("ser-cli ", env!("CARGO_PKG_VERSION"));

/// The beginning of a line that says how a file is laid out.
const FILE_LINE: &str = "{\"record\":\"file\",\"schema\":1,";

/// Writes lines like
/// `{"record":"entry","recorder":"U1","entry":17,"time":"2026-11-22T10:00:00.250","changed":[3,17],
/// "state":[3],"sequence":120,"life":"9f3c5a7e21b04d68"}`. What the file is comes first, even when
/// nothing follows.
pub(crate) struct JsonLines<W> {
    lines: Writer<W>,
    recorder: String,
    header_due: bool,
}

/// Whether a file with this first line need not be told its layout again.
pub(super) fn is_file_line(line: &str) -> bool {
    line.starts_with(FILE_LINE)
}

/// Writes what was seen of recorders to standard output, each record with the recorder's name.
pub(crate) fn write_records<'r>(
    told: impl Iterator<Item = (&'r str, &'r Record)>,
) -> crate::error::Result<()> {
    let (rows, has_header) = Rows::to_stdout(&is_file_line);
    let mut lines = Writer::new(rows);
    if !has_header {
        lines.file(PROGRAM)?;
    }
    for (recorder, record) in told {
        lines.record(recorder, record)?;
    }
    Ok(lines.flush()?)
}

impl<W: Write> JsonLines<W> {
    /// For the records of this recorder. `has_header` says whether the layout is already told.
    pub(crate) fn new(out: W, recorder: &str, has_header: bool) -> JsonLines<W> {
        let recorder = recorder.to_owned();
        JsonLines { lines: Writer::new(out), recorder, header_due: !has_header }
    }

    fn header(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.header_due) { self.lines.file(PROGRAM) } else { Ok(()) }
    }
}

impl From<&super::Event> for EntryRecord {
    fn from(event: &super::Event) -> EntryRecord {
        EntryRecord {
            life: event.life,
            sequence: event.sequence,
            number: event.number,
            entry: event.entry,
            known: EntryRecord::ALL_KNOWN,
        }
    }
}

impl From<&Loss> for Gap {
    fn from(loss: &Loss) -> Gap {
        ser_observer::gap(loss.life, loss.after, loss.lost)
    }
}

impl<W: Write> EventWriter for JsonLines<W> {
    fn event(&mut self, event: &super::Event) -> io::Result<()> {
        self.header()?;
        self.lines.entry(&self.recorder, &EntryRecord::from(event), event.note().as_deref())
    }

    fn lost(&mut self, loss: &Loss) -> io::Result<()> {
        self.evidence(&Record::Gap(Gap::from(loss)))
    }

    fn evidence(&mut self, record: &Record) -> io::Result<()> {
        self.header()?;
        self.lines.record(&self.recorder, record)
    }

    fn holds_evidence(&self) -> bool {
        true
    }

    fn flush(&mut self) -> io::Result<()> {
        self.header()?;
        self.lines.flush()
    }
}

#[cfg(test)]
mod tests {
    use ser_proto::Inputs;

    use super::*;
    use crate::output::testing::{entry, event, four_lost, odd};

    fn written(has_header: bool, write: impl FnOnce(&mut dyn EventWriter)) -> Vec<String> {
        let mut out = Vec::new();
        let mut lines = JsonLines::new(&mut out, "U1", has_header);
        write(&mut lines);
        lines.flush().unwrap();
        drop(lines);
        String::from_utf8(out).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn every_event_is_a_line_and_every_loss() {
        let inputs = Inputs(0b101);
        let lines = written(true, |lines| {
            lines.event(&event(2048, entry("00.250", &[3, 17], &[1, 3]))).unwrap();
            lines.lost(&four_lost()).unwrap();
            let lost = ser_client::Lost::Unrecorded { inputs };
            lines.lost(&Loss { lost, ..four_lost() }).unwrap();
            lines.event(&odd(event(1, entry("00.251", &[], &[])))).unwrap();
        });
        let life = "\"life\":\"00000000000000ab\"";
        let entry = "{\"record\":\"entry\",\"recorder\":\"U1\",\"entry\":";
        let gap = "{\"record\":\"gap\",\"recorder\":\"U1\",\"lost\":";
        assert_eq!(
            lines,
            [
                format!(
                    "{entry}2048,\"time\":\"2026-11-22T10:00:00.250\",\"changed\":[3,17],\
                     \"state\":[1,3],\"sequence\":5000,{life}}}"
                ),
                format!(
                    "{gap}4,\"count\":\"exactly\",\"after\":4996,\"why\":\"overwritten\",{life}}}"
                ),
                format!(
                    "{gap}null,\"count\":\"unknown\",\"after\":4996,\"why\":\"not recorded\",\
                     \"inputs\":[1,3],{life}}}"
                ),
                format!(
                    "{entry}1,\"time\":\"2026-11-22T10:00:00.251\",\"changed\":[],\"state\":[],\
                     \"sequence\":5000,{life},\"note\":\"month 13 is out of range; the clock \
                     went back\"}}"
                ),
            ]
        );
    }

    #[test]
    fn what_the_file_is_comes_first_and_only_once() {
        let [line] = &written(false, |lines| lines.flush().unwrap())[..] else { panic!() };
        assert!(is_file_line(line) && line.ends_with(&format!("\"{PROGRAM}\"}}")), "{line}");
        assert!(written(true, |_| ()).is_empty());
    }
}
