//! Where imported records go: JSON lines, written as they come.

use std::io::{self, Write};

use ser_evidence::record::Record;

use super::importer::Imported;
use crate::jsonl::Writer;

/// Writes records. The line that says who writes them comes before the first: a file without records
/// is empty.
pub struct Output<'p, W> {
    lines: Writer<W>,
    program: &'p str,
    is_begun: bool,
}

impl<'p, W: Write> Output<'p, W> {
    /// Writes to `out`. `program` is who writes.
    pub const fn new(out: W, program: &'p str) -> Output<'p, W> {
        Output { lines: Writer::new(out), program, is_begun: false }
    }

    /// Writes a record of a recorder, and the remark for people that goes with an entry.
    ///
    /// # Errors
    /// As `out`.
    pub fn record(
        &mut self,
        recorder: &str,
        record: &Record,
        note: Option<&str>,
    ) -> io::Result<()> {
        if !std::mem::replace(&mut self.is_begun, true) {
            self.lines.file(self.program)?;
        }
        match record {
            Record::Entry(entry) => self.lines.entry(recorder, entry, note),
            record => self.lines.record(recorder, record),
        }
    }

    /// Writes what all lists became, and passes everything on. Returns whether there was a record.
    ///
    /// # Errors
    /// As `out`.
    pub fn finish(mut self, imported: &Imported) -> io::Result<bool> {
        for (recorder, record, note) in imported.with_notes() {
            self.record(recorder, record, note)?;
        }
        self.lines.flush()?;
        Ok(self.is_begun)
    }
}
