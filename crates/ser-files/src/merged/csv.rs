//! The timeline as CSV: the columns of a reading, and what only a timeline knows.

use std::io::{self, Write};

use ser_evidence::time::Moment;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::super::report::{missing, names, rfc3339};

/// The columns. The first seven are those of a reading.
pub const HEADER: &str =
    "entry,time,input,state,sequence,life,note,recorder,utc,utc_earliest,utc_latest";

/// Writes every change of a timeline in a row of its own, and every gap.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, timeline: &Timeline<'_>) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    let mut row = Row::default();
    let mut is_after_set = false;
    for item in timeline.items() {
        match item {
            Item::Entry(event) => {
                row.entry(out, timeline, event, std::mem::take(&mut is_after_set))?;
            }
            Item::Gap(event, index) => row.gap(out, timeline, event, index)?,
            Item::ClockSet(_) => is_after_set = true,
        }
    }
    Ok(())
}

/// What is used again and again while rows are written.
#[derive(Default)]
struct Row {
    /// The end of the rows of an entry, which they share.
    tail: String,
    /// The name of the recorder that `quoted` is of.
    recorder: Option<u32>,
    quoted: String,
}

impl Row {
    fn entry(
        &mut self,
        out: &mut dyn Write,
        timeline: &Timeline<'_>,
        event: EventId,
        is_after_set: bool,
    ) -> io::Result<()> {
        let (Some(held), Some(life)) = (timeline.held(event), timeline.life(event)) else {
            return Ok(());
        };
        self.turn_to(timeline, event);
        let note = if is_after_set { "clock was set before this" } else { "" };
        let bound = timeline.moved_utc(event, None);
        let end =
            |end: Option<Moment<_>>| end.and_then(|end| rfc3339(end.us())).unwrap_or_default();
        self.tail.clear();
        use std::fmt::Write as _;
        // Writing to a string does not fail.
        let _ = write!(
            self.tail,
            ",{},{},{note},{},{},{},{}",
            held.sequence,
            life.name(),
            self.quoted,
            timeline
                .time(event)
                .map(ser_evidence::time::Moment::us)
                .and_then(rfc3339)
                .unwrap_or_default(),
            end(bound.lo()),
            end(bound.hi()),
        );
        let (number, time, entry) = (held.number, held.entry.time, held.entry);
        if entry.changed.is_empty() {
            return writeln!(out, "{number},{time},,{}", self.tail);
        }
        for input in entry.changed.numbers() {
            let state = u8::from(entry.state.contains(input));
            writeln!(out, "{number},{time},{input},{state}{}", self.tail)?;
        }
        Ok(())
    }

    fn gap(
        &mut self,
        out: &mut dyn Write,
        timeline: &Timeline<'_>,
        event: EventId,
        index: usize,
    ) -> io::Result<()> {
        self.turn_to(timeline, event);
        let Some(life) = timeline.life(event) else { return Ok(()) };
        let Some(gap) = life.gaps.get(index) else { return Ok(()) };
        let note = missing(gap.lost, gap.why);
        writeln!(out, ",,,,{},{},{},{},,,", gap.after, life.name(), quoted(&note), self.quoted)
    }

    fn turn_to(&mut self, timeline: &Timeline<'_>, event: EventId) {
        if self.recorder != Some(event.recorder) {
            let name = timeline.recorder(event);
            let name = name.map(|found| quoted(&names::harmless(&found.recorder.name)));
            self.quoted = name.unwrap_or_default();
            self.recorder = Some(event.recorder);
        }
    }
}

/// A text as a field.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}
