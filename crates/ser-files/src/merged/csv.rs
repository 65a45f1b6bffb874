//! The timeline as CSV: the columns of a reading, and what only a timeline knows.

use std::io::{self, Write};

use ser_evidence::history::Held;
use ser_evidence::record::{Gap, Life};
use ser_evidence::time::Moment;
use ser_evidence::timeline::{EventId, Item, Timeline};

use super::super::report::names;
use crate::csv::loss_note;
use crate::digits::{UtcTexts, push_number, push_stamp};

/// The columns. The first seven are those of a reading.
pub const HEADER: &str =
    "entry,time,input,state,sequence,life,note,recorder,utc,utc_earliest,utc_latest";

/// Writes every change of a timeline in a row of its own, and every gap.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, timeline: &Timeline<'_>) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    let mut rows = Rows::of(timeline);
    let mut is_after_set = false;
    for item in timeline.items() {
        match item {
            Item::Entry(event) => {
                let is_after_set = std::mem::take(&mut is_after_set);
                out.write_all(rows.entry(timeline, event, is_after_set))?;
            }
            Item::Gap(event, index) => rows.gap(out, timeline, event, index)?,
            Item::ClockSet(_) => is_after_set = true,
        }
    }
    let missed = timeline.history().recorders.iter().filter(|recorder| recorder.is_not_reached);
    for history in missed {
        let recorder = quoted(&names::harmless(&history.recorder.name));
        writeln!(out, ",,,,,,{},{recorder},,,", quoted(&loss_note(&Gap::NOT_REACHED)))?;
    }
    Ok(())
}

/// What rows are made of, and where they are made.
struct Rows {
    /// By recorder: its name as a field, and the names of its lives.
    names: Vec<(String, Vec<String>)>,
    utc: UtcTexts,
    /// What the rows of an entry begin and end with.
    head: Vec<u8>,
    tail: Vec<u8>,
    /// All rows of an entry.
    rows: Vec<u8>,
}

impl Rows {
    fn of(timeline: &Timeline<'_>) -> Rows {
        let names = timeline.history().recorders.iter().map(|history| {
            let lives = history.lives.iter().map(|life| life.name().to_string());
            (quoted(&names::harmless(&history.recorder.name)), lives.collect())
        });
        Rows {
            names: names.collect(),
            utc: UtcTexts::default(),
            head: Vec::new(),
            tail: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// The rows of an entry.
    fn entry(&mut self, timeline: &Timeline<'_>, event: EventId, is_after_set: bool) -> &[u8] {
        self.rows.clear();
        let Some(&Held { sequence, entry, number, .. }) = timeline.held(event) else {
            return &self.rows;
        };
        self.head.clear();
        push_number(&mut self.head, number.into());
        self.head.push(b',');
        push_stamp(&mut self.head, &entry.time);
        self.head.push(b',');
        let note = if is_after_set { "clock was set before this" } else { "" };
        // A reading by number tells no sequence.
        let is_by_number = timeline.life(event).is_some_and(|life| life.is_by_number);
        self.make_tail(timeline, event, (!is_by_number).then_some(sequence), note);
        if entry.changed.is_empty() {
            [&*self.head, b",", &*self.tail].iter().for_each(|part| self.rows.extend(*part));
        }
        for input in entry.changed.numbers() {
            self.rows.extend_from_slice(&self.head);
            push_number(&mut self.rows, input.into());
            let state: &[u8] = if entry.state.contains(input) { b",1" } else { b",0" };
            self.rows.extend_from_slice(state);
            self.rows.extend_from_slice(&self.tail);
        }
        &self.rows
    }

    /// What comes after the state.
    fn make_tail(
        &mut self,
        timeline: &Timeline<'_>,
        event: EventId,
        sequence: Option<u64>,
        note: &str,
    ) {
        let tail = &mut self.tail;
        let bound = timeline.moved_utc(event, None);
        let ends = [bound.lo(), bound.hi()].map(|end| end.map(Moment::us));
        tail.clear();
        tail.push(b',');
        if let Some(sequence) = sequence {
            push_number(tail, sequence);
        }
        let (life, recorder) = names(&self.names, event);
        for text in [life, note, recorder] {
            tail.push(b',');
            tail.extend_from_slice(text.as_bytes());
        }
        for us in [timeline.time(event).map(Moment::us)].into_iter().chain(ends) {
            tail.push(b',');
            if let Some(us) = us {
                self.utc.push(tail, us);
            }
        }
        tail.push(b'\n');
    }

    fn gap(
        &self,
        out: &mut dyn Write,
        timeline: &Timeline<'_>,
        event: EventId,
        index: usize,
    ) -> io::Result<()> {
        let Some(gap) = timeline.life(event).and_then(|life| life.gaps.get(index)) else {
            return Ok(());
        };
        let (life, recorder) = names(&self.names, event);
        let (lost, why) = (gap.lost, gap.why);
        let note = loss_note(&Gap { life: Life::UNKNOWN, after: Some(gap.after), lost, why });
        writeln!(out, ",,,,{},{life},{},{recorder},,,", gap.after, quoted(&note))
    }
}

/// The names of the life and the recorder of an entry.
fn names(names: &[(String, Vec<String>)], event: EventId) -> (&str, &str) {
    let Some((recorder, lives)) = names.get(event.recorder as usize) else { return ("", "") };
    (lives.get(event.life as usize).map_or("", String::as_str), recorder)
}

/// A text as a field.
fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}
