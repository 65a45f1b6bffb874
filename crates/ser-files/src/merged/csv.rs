//! The timeline as CSV: the columns of a reading, and what only a timeline knows.

use std::io::{self, Write};

use ser_evidence::history::Held;
use ser_evidence::record::Gap;
use ser_evidence::time::Moment;
use ser_evidence::timeline::{ChangeId, EventId, Item, Timeline};

use super::dialect::{Dialect, field};
use crate::csv::loss_note;
use crate::digits::{UtcTexts, push_german, push_number, push_stamp};
use crate::names;

/// The columns. The first seven are those of a reading.
pub const HEADER: &str =
    "entry,time,input,state,sequence,life,note,recorder,utc,utc_earliest,utc_latest";

/// The columns of an export that are not those of a list: what the site file calls the input and
/// its state.
const NAMES: &str = ",point,meaning";

/// How the rows are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CsvStyle {
    /// For which program.
    pub dialect: Dialect,
    /// Whether texts that a spreadsheet would take for a formula or a number are made harmless.
    pub is_spreadsheet_safe: bool,
    /// Whether there are columns for the names of points and of their states.
    pub has_names: bool,
}

/// Writes every change of a timeline in a row of its own, and every gap.
///
/// # Errors
/// If `out` does not take it.
pub fn write(out: &mut dyn Write, timeline: &Timeline<'_>) -> io::Result<()> {
    write_items(out, timeline, timeline.items(), CsvStyle::default())
}

/// As [`write()`], with these entries and gaps only, and of the entries with these changes only; with
/// columns for the names of points and states.
///
/// # Errors
/// If `out` does not take it.
pub fn write_chosen(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    items: impl Iterator<Item = Item>,
    wants: &dyn Fn(ChangeId) -> bool,
) -> io::Result<()> {
    let style = CsvStyle { has_names: true, ..CsvStyle::default() };
    write_wanted(out, timeline, items, style, wants)
}

/// As [`write()`], with these entries and gaps only, and in this style.
pub(crate) fn write_items(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    items: impl Iterator<Item = Item>,
    style: CsvStyle,
) -> io::Result<()> {
    write_wanted(out, timeline, items, style, &|_| true)
}

fn write_wanted(
    out: &mut dyn Write,
    timeline: &Timeline<'_>,
    items: impl Iterator<Item = Item>,
    style: CsvStyle,
    wants: &dyn Fn(ChangeId) -> bool,
) -> io::Result<()> {
    let mut rows = Rows::of(timeline, style);
    out.write_all(&rows.header())?;
    let mut is_after_set = false;
    for item in items {
        match item {
            Item::Entry(event) => {
                let is_after_set = std::mem::take(&mut is_after_set);
                out.write_all(rows.entry(timeline, event, is_after_set, wants))?;
            }
            Item::Gap(event, index) => out.write_all(&rows.gap(timeline, event, index))?,
            Item::ClockSet(_) => is_after_set = true,
        }
    }
    let missed = timeline.history().recorders.iter().filter(|recorder| recorder.is_not_reached);
    for history in missed {
        out.write_all(&rows.not_reached(&history.recorder.name))?;
    }
    Ok(())
}

/// What rows are made of, and where they are made.
struct Rows {
    style: CsvStyle,
    separator: u8,
    /// By recorder and input: what follows the other columns, by [`side`].
    points: Vec<Vec<[Vec<u8>; 3]>>,
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
    fn of(timeline: &Timeline<'_>, style: CsvStyle) -> Rows {
        let field = |text: &str| field(text, style.dialect, style.is_spreadsheet_safe);
        let names = timeline.history().recorders.iter().map(|history| {
            let lives = history.lives.iter().map(|life| field(&life.name().to_string()));
            (field(&names::harmless(&history.recorder.name)), lives.collect())
        });
        Rows {
            style,
            separator: style.dialect.separator(),
            points: if style.has_names { points(timeline, style) } else { Vec::new() },
            names: names.collect(),
            utc: UtcTexts::default(),
            head: Vec::new(),
            tail: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// The first line.
    fn header(&self) -> Vec<u8> {
        let names = if self.style.has_names { NAMES } else { "" };
        let mut line = self.style.dialect.mark().as_bytes().to_vec();
        let columns = HEADER.bytes().chain(names.bytes());
        line.extend(columns.map(|byte| if byte == b',' { self.separator } else { byte }));
        line.extend_from_slice(self.style.dialect.line_end());
        line
    }

    /// The rows of an entry.
    fn entry(
        &mut self,
        timeline: &Timeline<'_>,
        event: EventId,
        is_after_set: bool,
        wants: &dyn Fn(ChangeId) -> bool,
    ) -> &[u8] {
        self.rows.clear();
        let Some(held) = timeline.held(event) else { return &self.rows };
        let Held { sequence, entry, number, .. } = *held;
        self.head.clear();
        push_number(&mut self.head, number.into());
        self.head.push(self.separator);
        match self.style.dialect {
            Dialect::Plain | Dialect::Rfc4180 => push_stamp(&mut self.head, &entry.time),
            Dialect::ExcelDe => push_german(&mut self.head, &entry.time),
        }
        self.head.push(self.separator);
        let note = if is_after_set { "clock was set before this" } else { "" };
        // A reading by number tells no sequence.
        let is_by_number = timeline.life(event).is_some_and(|life| life.is_by_number);
        self.make_tail(timeline, event, (!is_by_number).then_some(sequence), note);
        if entry.changed.is_empty() {
            let none = [self.separator];
            [&*self.head, &none, &*self.tail].iter().for_each(|part| self.rows.extend(*part));
            self.end_row(None);
        }
        let changes = entry.changed.numbers();
        for input in changes.filter(|&input| wants(ChangeId { event, input })) {
            self.rows.extend_from_slice(&self.head);
            push_number(&mut self.rows, input.into());
            let on = held.state_of(input);
            let state = on.map_or(b'?', |on| if on { b'1' } else { b'0' });
            self.rows.extend_from_slice(&[self.separator, state]);
            self.rows.extend_from_slice(&self.tail);
            self.end_row(Some((event, input, on)));
        }
        &self.rows
    }

    /// Ends a row with the names of what changed.
    fn end_row(&mut self, change: Option<(EventId, u8, Option<bool>)>) {
        if self.style.has_names {
            let names = change.and_then(|(event, input, on)| {
                let place = usize::from(input).checked_sub(1)?;
                let of_input = self.points.get(event.recorder as usize)?.get(place)?;
                of_input.get(side(on))
            });
            match names {
                Some(names) => self.rows.extend_from_slice(names),
                None => self.rows.extend_from_slice(&[self.separator; 2]),
            }
        }
        self.rows.extend_from_slice(self.style.dialect.line_end());
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
        let separator = self.separator;
        tail.clear();
        tail.push(separator);
        if let Some(sequence) = sequence {
            push_number(tail, sequence);
        }
        let (life, recorder) = names(&self.names, event);
        for text in [life, note, recorder] {
            tail.push(separator);
            tail.extend_from_slice(text.as_bytes());
        }
        let [earliest, latest] = ends;
        let middle = timeline.time(event).map(Moment::us);
        // Where a column has milliseconds only, the ends are not rounded towards each other.
        for (us, up_us) in [(middle, 500), (earliest, 0), (latest, 999)] {
            tail.push(separator);
            let Some(us) = us else { continue };
            match self.style.dialect {
                Dialect::Plain | Dialect::Rfc4180 => self.utc.push(tail, us),
                Dialect::ExcelDe => self.utc.push_german(tail, us.saturating_add(up_us)),
            }
        }
    }

    fn gap(&self, timeline: &Timeline<'_>, event: EventId, index: usize) -> Vec<u8> {
        let Some(life) = timeline.life(event) else { return Vec::new() };
        let Some(gap) = life.gaps.get(index) else { return Vec::new() };
        let (life_name, recorder) = names(&self.names, event);
        self.loss(&gap.record(life.name()), life_name, recorder)
    }

    /// The row of a recorder that could not be reached.
    fn not_reached(&self, recorder: &str) -> Vec<u8> {
        let CsvStyle { dialect, is_spreadsheet_safe, .. } = self.style;
        let recorder = field(&names::harmless(recorder), dialect, is_spreadsheet_safe);
        self.loss(&Gap::NOT_REACHED, "", &recorder)
    }

    fn loss(&self, gap: &Gap, life: &str, recorder: &str) -> Vec<u8> {
        let CsvStyle { dialect, is_spreadsheet_safe, has_names } = self.style;
        let note = field(&loss_note(gap), dialect, is_spreadsheet_safe);
        let after = gap.after.map(|after| after.to_string()).unwrap_or_default();
        let names: &[&str] = if has_names { &["", ""] } else { &[] };
        let fields = ["", "", "", "", &after, life, &note, recorder, "", "", ""];
        let mut row = Vec::new();
        for (place, text) in fields.iter().chain(names).enumerate() {
            if place > 0 {
                row.push(self.separator);
            }
            row.extend_from_slice(text.as_bytes());
        }
        row.extend_from_slice(dialect.line_end());
        row
    }
}

/// Where what belongs to a state is among three: off, on, and not known.
fn side(on: Option<bool>) -> usize {
    on.map_or(2, usize::from)
}

/// By recorder and input: its names as fields, each after a separator, by [`side`].
fn points(timeline: &Timeline<'_>, style: CsvStyle) -> Vec<Vec<[Vec<u8>; 3]>> {
    let site = timeline.site();
    let of_input = |id: Option<_>, input: u8| {
        [Some(false), Some(true), None].map(|on| {
            let Some(point) = id else { return vec![style.dialect.separator(); 2] };
            let texts =
                [names::point(timeline, Some(point), input), names::state(timeline, id, on)];
            let mut fields = Vec::new();
            for text in texts {
                fields.push(style.dialect.separator());
                let text = field(&text, style.dialect, style.is_spreadsheet_safe);
                fields.extend_from_slice(text.as_bytes());
            }
            fields
        })
    };
    let of_recorder = |recorder: &ser_evidence::history::RecorderHistory| {
        let point = |input| recorder.site.and_then(|id| site.point_at(id, input));
        (1..=32).map(|input| of_input(point(input), input)).collect()
    };
    timeline.history().recorders.iter().map(of_recorder).collect()
}

/// The names of the life and the recorder of an entry.
fn names(names: &[(String, Vec<String>)], event: EventId) -> (&str, &str) {
    let Some((recorder, lives)) = names.get(event.recorder as usize) else { return ("", "") };
    (lives.get(event.life as usize).map_or("", String::as_str), recorder)
}
