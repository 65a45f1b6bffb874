//! The sequence of changes: a row for each, in the order of the timeline.

use std::collections::BTreeSet;
use std::io::{self, Write};

use anstyle::Style;
use ser_evidence::clock::Nominal;
use ser_evidence::incident::Row;
use ser_evidence::timeline::{ChangeId, EventId, Order, Timeline};

use super::{heading, names};
use crate::report::span::{doubt, since};
use crate::report::style::Styles;
use crate::report::table::{Align, Cell, Table};
use crate::report::verdict;
use crate::report::{Clock, Document};

/// Columns of the table, from 0.
const TIME: usize = 1;
const RECORDER: usize = 5;
const POINT: usize = 6;
const COLUMNS: usize = 10;

/// Notes that are longer go below their row, so that rows fit a terminal.
const NOTE_WIDTH: usize = "maybe first-out".len();

pub(super) fn write(
    out: &mut dyn Write,
    document: &Document<'_>,
    styles: Styles,
    clock: &Clock,
) -> io::Result<()> {
    heading(out, "Sequence", styles)?;
    let mut table = Table::new(vec![
        ("", Align::Left),
        ("time", Align::Left),
        ("Δ first", Align::Right),
        ("Δ prev", Align::Right),
        ("doubt", Align::Right),
        ("recorder", Align::Left),
        ("point", Align::Left),
        ("state", Align::Left),
        ("entry", Align::Right),
        ("", Align::Left),
    ]);
    let rows = shown_rows(document);
    let brackets = brackets(document.timeline, &rows);
    let mut previous = None;
    for (row, bracket) in rows.iter().zip(&brackets) {
        gaps_ahead(document, row, previous, &mut table, styles);
        let notes = notes(document, row, previous, bracket, clock);
        let is_short = notes.chars().count() <= NOTE_WIDTH;
        let (beside, below) = if is_short { (notes, None) } else { (String::new(), Some(notes)) };
        table.row(cells(document, row, previous, (bracket.sign, beside), styles, clock));
        if let Some(notes) = below {
            let sign = if matches!(bracket.sign, "┌" | "│") { "│" } else { "" };
            table.row(sparse([
                (0, Cell::styled(sign, styles.alarm)),
                (POINT, Cell::remark(notes, styles.faint)),
            ]));
        }
        previous = Some(row.change);
    }
    let last = document.report.incident.gaps.iter().filter(|(event, _)| {
        document.timeline.held(*event).is_none() || !document.report.incident.events.contains(event)
    });
    for &(event, index) in last {
        gap_row(document.timeline, event, index, &mut table, styles);
    }
    table.write(out, styles.faint)
}

/// All rows, or those that are not folded away.
fn shown_rows<'d>(document: &Document<'d>) -> Vec<&'d Row> {
    let folded: BTreeSet<ChangeId> = match document.unfold {
        true => BTreeSet::new(),
        false => {
            let folds = document.report.chatter.iter();
            folds.flat_map(|fold| fold.changes.iter().skip(1).copied()).collect()
        }
    };
    document.report.rows.iter().filter(|row| !folded.contains(&row.change)).collect()
}

/// Where a row stands among those whose order is not known.
#[derive(Clone, Debug, Default)]
struct Bracket {
    sign: &'static str,
    /// At the end of one: what is said about it.
    note: Option<String>,
}

/// Neighbours whose order is not known are in one bracket.
fn brackets(timeline: &Timeline<'_>, rows: &[&Row]) -> Vec<Bracket> {
    let is_unknown = |one: &Row, other: &Row| {
        timeline.order(one.change.event, other.change.event) == Order::Unknown
    };
    let mut brackets = vec![Bracket::default(); rows.len()];
    let mut first = 0;
    while first < rows.len() {
        let mut last = first;
        // A row belongs to it if its order to any of them is not known.
        while let Some(next) = rows.get(last + 1)
            && rows
                .get(first..=last)
                .is_some_and(|these| these.iter().any(|row| is_unknown(row, next)))
        {
            last += 1;
        }
        if last > first {
            for (place, bracket) in
                brackets.iter_mut().enumerate().skip(first).take(last + 1 - first)
            {
                bracket.sign = match place {
                    place if place == first => "┌",
                    place if place == last => "└",
                    _ => "│",
                };
            }
            if let (Some(bracket), Some(these)) = (brackets.get_mut(last), rows.get(first..=last)) {
                bracket.note = Some(unknown_within(timeline, these));
            }
        }
        first = last + 1;
    }
    brackets
}

/// How far apart the truth of neighbours of unknown order may be.
fn unknown_within(timeline: &Timeline<'_>, rows: &[&Row]) -> String {
    if let [one, other] = rows
        && timeline.same_movement(one.change) == Some(other.change)
    {
        return "the same contact on both".to_owned();
    }
    let mut widest = 0;
    for (place, one) in rows.iter().enumerate() {
        for other in rows.iter().skip(place + 1) {
            if timeline.order(one.change.event, other.change.event) != Order::Unknown {
                continue;
            }
            let delta = timeline.delta(one.change, other.change);
            match (delta.lo_us, delta.hi_us) {
                (Some(lo), Some(hi)) => widest = widest.max(lo.abs()).max(hi.abs()),
                _ => return "order not known".to_owned(),
            }
        }
    }
    format!("order unknown within {}", doubt(widest))
}

fn cells(
    document: &Document<'_>,
    row: &Row,
    previous: Option<ChangeId>,
    (sign, notes): (&str, String),
    styles: Styles,
    clock: &Clock,
) -> Vec<Cell> {
    let Document { timeline, report, .. } = *document;
    let ChangeId { event, input } = row.change;
    let first = report.rows.first().map(|row| row.change);
    let is_first = report.first_out.includes(timeline, row.change);
    let delta = |from: Option<ChangeId>| {
        let us = from.and_then(|from| timeline.delta(from, row.change).middle_us());
        Cell::from(us.map(since).unwrap_or_default())
    };
    let time = timeline
        .time(event)
        .map(ser_evidence::time::Moment::us)
        .map_or("not known".to_owned(), |at| clock.time(at));
    let off = timeline
        .moved_on(event, Some(input))
        .values()
        .next()
        .and_then(|&(lo, hi)| Some(hi?.saturating_sub(lo?) / 2));
    let state_style = match names::is_abnormal(timeline, row.point, row.on) {
        Some(true) => styles.abnormal,
        _ => Style::new(),
    };
    let since_first = if first == Some(row.change) { Cell::default() } else { delta(first) };
    vec![
        Cell::styled(sign, styles.alarm),
        Cell::styled(time, if is_first { styles.first_out } else { Style::new() }),
        since_first,
        delta(previous),
        Cell::styled(off.map_or("?".to_owned(), |us| format!("± {}", doubt(us))), styles.faint),
        Cell::from(names::recorder(timeline, event)),
        Cell::from(names::point(timeline, row.point, input)),
        Cell::styled(names::state(timeline, row.point, row.on), state_style),
        Cell::from(timeline.held(event).map_or(String::new(), |held| held.sequence.to_string())),
        Cell::from(notes),
    ]
}

/// What else is to be said about a change.
fn notes(
    document: &Document<'_>,
    row: &Row,
    previous: Option<ChangeId>,
    bracket: &Bracket,
    clock: &Clock,
) -> String {
    let Document { timeline, report, .. } = *document;
    let is_first = report.first_out.includes(timeline, row.change);
    let mut notes = Vec::new();
    if is_first {
        let is_known = report.first_out.known().is_some();
        notes.push(if is_known { "first-out" } else { "maybe first-out" }.to_owned());
    }
    if previous.is_some_and(|previous| previous.event == row.change.event) {
        notes.push("same millisecond".to_owned());
    }
    let fold = report.chatter.iter().find(|fold| fold.first == row.change);
    if let Some(fold) = fold {
        let last = fold.changes.last().copied();
        let lasted = last.and_then(|last| timeline.delta(row.change, last).middle_us());
        let lasted = lasted.map_or(String::new(), |us| format!(", last {}", since(us)));
        notes.push(format!("chatter ×{}{lasted}", fold.changes.len()));
    }
    notes.extend(local_time_note(timeline, row.change.event, clock));
    let shift = timeline.shift_us(row.change.event);
    if shift != 0 {
        notes.push(format!("shifted by hand {}", since(shift)));
    }
    notes.extend(bracket.note.clone());
    notes.join("; ")
}

/// What is to be said of a local time that nobody observed.
fn local_time_note(timeline: &Timeline<'_>, event: EventId, clock: &Clock) -> Option<String> {
    if timeline.moved_utc(event, None).is_known() {
        return None;
    }
    match timeline.nominal(event) {
        Nominal::Ambiguous(early, late) => Some(format!(
            "this hour came twice: {} or {}",
            clock.date_and_time_with_offset(early.us()),
            clock.date_and_time_with_offset(late.us())
        )),
        Nominal::Missing(_) => Some("this hour was left out".to_owned()),
        Nominal::Time(_) | Nominal::NotKnown => None,
    }
}

/// What is missing ahead of a row, a row for each.
fn gaps_ahead(
    document: &Document<'_>,
    row: &Row,
    previous: Option<ChangeId>,
    table: &mut Table,
    styles: Styles,
) {
    if previous.is_some_and(|previous| previous.event == row.change.event) {
        return;
    }
    for &(event, index) in &document.report.incident.gaps {
        if event == row.change.event {
            gap_row(document.timeline, event, index, table, styles);
        }
    }
    // Ahead of the first entry of a log, nothing was stamped by the clock as it was before.
    let is_first_of_log = row.change.event.place == 0;
    if !is_first_of_log && document.report.incident.clock_sets.contains(&row.change.event) {
        let recorder = names::recorder(document.timeline, row.change.event);
        remark_row("the clock was set here", recorder, table, styles.faint);
    }
}

/// A row of its own for what is no change.
fn remark_row(text: &str, recorder: String, table: &mut Table, style: Style) {
    table.row(sparse([
        (TIME, Cell::styled("- - -", style)),
        (RECORDER, Cell::styled(recorder, style)),
        (POINT, Cell::remark(text.to_owned(), style)),
    ]));
}

fn gap_row(
    timeline: &Timeline<'_>,
    event: EventId,
    index: usize,
    table: &mut Table,
    styles: Styles,
) {
    let Some(gap) = timeline.life(event).and_then(|life| life.gaps.get(index)) else { return };
    let recorder = names::recorder(timeline, event);
    remark_row(&verdict::missing(gap.lost, gap.why), recorder, table, styles.alarm);
}

/// A row in which most cells are empty.
fn sparse<const N: usize>(filled: [(usize, Cell); N]) -> Vec<Cell> {
    let mut cells = vec![Cell::default(); COLUMNS];
    for (column, cell) in filled {
        if let Some(place) = cells.get_mut(column) {
            *place = cell;
        }
    }
    cells
}
