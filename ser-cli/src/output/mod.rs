//! Events on standard output: as a table, as CSV or as JSON lines.

mod csv;
mod elapsed;
mod grid;
mod jsonl;
mod offset;
mod palette;
mod points;
mod record;
mod rows;
mod site_table;
mod table;

use std::io::{self, Write};

use clap::ValueEnum;
use ser_console::is_obeyed;

pub(crate) use csv::Csv;
pub(crate) use elapsed::Elapsed;
pub(crate) use grid::Grid;
pub(crate) use jsonl::{JsonLines, PROGRAM, write_records};
pub(crate) use offset::{ago, offset};
pub(crate) use palette::Palette;
pub(crate) use points::Points;
pub(crate) use record::{Annotator, Before, Event, Loss, Record};
pub(crate) use rows::{Rows, sync_stdout};
pub use ser_evidence::record::Life;
pub(crate) use site_table::{RecorderColumn, RowOrder, SiteTable, header as site_header};
pub(crate) use table::Table;

/// The format of events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people: with the time since the previous and since the first event.
    #[default]
    Table,
    /// One row per input that changed: entry,time,input,state,sequence,life,note.
    Csv,
    /// One JSON object per record: events, losses, and what else the reading proves.
    Jsonl,
}

/// Takes events and losses in the order in which they happened.
pub(crate) trait EventWriter {
    /// Writes an event.
    fn event(&mut self, event: &Event) -> io::Result<()>;

    /// Writes that events are missing here.
    fn lost(&mut self, loss: &Loss) -> io::Result<()>;

    /// Writes what else is known. Formats for people and for spreadsheets have no place for it.
    fn evidence(&mut self, _record: &ser_evidence::record::Record) -> io::Result<()> {
        Ok(())
    }

    /// Whether [`evidence`](Self::evidence) is written.
    fn holds_evidence(&self) -> bool {
        false
    }

    /// Passes on what has been written so far, in whole rows.
    fn flush(&mut self) -> io::Result<()>;

    /// Gives inputs their names, where they are for people.
    fn name_points(&mut self, _points: Points) {}
}

/// The writer of `format` on standard output, for what this recorder tells. A continued file gets no
/// second header.
pub(crate) fn to_stdout(format: Format, recorder: &str) -> Box<dyn EventWriter> {
    match format {
        Format::Table => {
            let (rows, has_header) = Rows::to_stdout(&|line| line == table::header());
            Box::new(Table::new(rows, Palette::of_stdout(), has_header))
        }
        Format::Csv => {
            let (rows, has_header) = Rows::to_stdout(&|line| line == csv::HEADER);
            Box::new(Csv::new(rows, has_header))
        }
        Format::Jsonl => {
            let (rows, has_header) = Rows::to_stdout(&jsonl::is_file_line);
            Box::new(JsonLines::new(rows, recorder, has_header))
        }
    }
}

/// Writes `name` and its value in two columns, as `status` and `config` do.
pub(crate) fn field(
    out: &mut dyn Write,
    name: &str,
    value: impl std::fmt::Display,
) -> io::Result<()> {
    writeln!(out, "{name:<16}{value}")
}

/// Writes one JSON object over several lines. Inside of texts nothing is left that a terminal would
/// obey: it is escaped, and read back as it was.
pub(crate) fn json_to(out: &mut dyn Write, json: &serde_json::Value) -> io::Result<()> {
    let mut harmless = String::new();
    for letter in serde_json::to_string_pretty(json)?.chars() {
        match letter != '\n' && is_obeyed(letter) {
            // All of them are in the first plane.
            true => harmless += &format!("\\u{:04x}", u32::from(letter)),
            false => harmless.push(letter),
        }
    }
    writeln!(out, "{harmless}")
}

#[cfg(test)]
pub(crate) mod testing {
    //! Events that every writer is tested with.

    pub(crate) use super::points::testing::points;
    use ser_client::Lost;
    use ser_proto::{Entry, Inputs};

    use super::record::Note;
    use super::{Event, Life, Loss};
    use crate::time::parse_time;

    /// An event at 10:00 plus `time`, given as `00.250`.
    pub(crate) fn entry(time: &str, changed: &[u8], state: &[u8]) -> Entry {
        let set = |numbers: &[u8]| {
            Inputs(numbers.iter().fold(0, |bits, number| bits | 1 << (number - 1)))
        };
        Entry {
            changed: set(changed),
            state: set(state),
            time: parse_time(&format!("2026-11-22T10:00:{time}")).expect("a time"),
        }
    }

    /// A life that is known.
    pub(crate) fn life() -> Life {
        Life::from_name("00000000000000ab").expect("a name")
    }

    /// The same as event 5000 of a log whose life is known.
    pub(crate) fn event(number: u16, entry: Entry) -> Event {
        let life = life();
        Event { number, sequence: Some(5000), life, entry, notes: Vec::new() }
    }

    /// The same with a note.
    pub(crate) fn odd(mut event: Event) -> Event {
        event.notes = vec![Note::Odd("month 13 is out of range".to_string()), Note::ClockWentBack];
        event
    }

    /// Four overwritten events.
    pub(crate) fn four_lost() -> Loss {
        let life = Life::from_name("00000000000000ab").expect("a name");
        Loss { after: Some(4996), life, lost: Lost::Overwritten { count: 4 } }
    }
}
