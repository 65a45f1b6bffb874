//! The sequence of changes as a table.

use std::io::{self, Write};

use anstyle::Style;

use super::heading;
use crate::report::sequence::{ChangeLine, Line, Remark, Sign, lines, timeless as timeless_lines};
use crate::report::style::Styles;
use crate::report::table::{Align, Cell, Table};
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
    for line in lines(document, clock) {
        match line {
            Line::Change(change) => add_change(&change, &mut table, styles),
            Line::Remark(remark) => add_remark(remark, &mut table, styles),
        }
    }
    table.write(out, styles.faint)?;
    timeless(out, document, styles)
}

/// Changes of which nobody knows when they were.
fn timeless(out: &mut dyn Write, document: &Document<'_>, styles: Styles) -> io::Result<()> {
    let lines = timeless_lines(document);
    if lines.is_empty() {
        return Ok(());
    }
    heading(out, "Time not known", styles)?;
    writeln!(out, "the clock was never set: these came before the next entry of their recorder")?;
    let mut table = Table::new(vec![
        ("its clock showed", Align::Left),
        ("recorder", Align::Left),
        ("point", Align::Left),
        ("state", Align::Left),
        ("entry", Align::Right),
        ("", Align::Left),
    ]);
    for line in lines {
        table.row(vec![
            Cell::from(line.showed),
            Cell::from(line.recorder),
            Cell::from(line.point),
            Cell::from(line.state),
            Cell::from(line.entry),
            Cell::styled(line.note, styles.first_out),
        ]);
    }
    table.write(out, styles.faint)
}

fn add_change(line: &ChangeLine<'_>, table: &mut Table, styles: Styles) {
    let notes = line.notes.join("; ");
    let is_short = notes.chars().count() <= NOTE_WIDTH;
    let (beside, below) = if is_short { (notes, None) } else { (String::new(), Some(notes)) };
    let style_if = |is_it: bool, style: Style| if is_it { style } else { Style::new() };
    table.row(vec![
        Cell::styled(drawn(line.bracket), styles.alarm),
        Cell::styled(line.time.as_str(), style_if(line.is_first, styles.first_out)),
        Cell::from(line.since_first.clone()),
        Cell::from(line.since_previous.clone()),
        Cell::styled(line.doubt.as_str(), styles.faint),
        Cell::from(line.recorder.clone()),
        Cell::from(line.point.clone()),
        Cell::styled(line.state.as_str(), style_if(line.is_abnormal, styles.abnormal)),
        Cell::from(line.entry.clone()),
        Cell::from(beside),
    ]);
    if let Some(notes) = below {
        table.row(sparse([
            (0, Cell::styled(drawn(line.bracket.below()), styles.alarm)),
            (POINT, Cell::remark(notes, styles.faint)),
        ]));
    }
}

fn add_remark(remark: Remark, table: &mut Table, styles: Styles) {
    let style = if remark.is_loss { styles.alarm } else { styles.faint };
    table.row(sparse([
        (0, Cell::styled(drawn(remark.bracket), styles.alarm)),
        (TIME, Cell::styled("- - -", style)),
        (RECORDER, Cell::styled(remark.recorder, style)),
        (POINT, Cell::remark(remark.text, style)),
    ]));
}

/// A part of a bracket.
const fn drawn(sign: Sign) -> &'static str {
    match sign {
        Sign::None => "",
        Sign::First => "┌",
        Sign::Inner => "│",
        Sign::Passed => "┆",
        Sign::Last => "└",
    }
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
