//! Columns that are as wide as their widest cell, where a line has room for them.

use std::io::{self, Write};

use anstyle::Style;
use unicode_width::UnicodeWidthStr;

/// How wide lines are. Longer names of recorders and points make them longer, nothing else does.
pub(super) const WIDTH: usize = 100;

/// Columns of sentences stay at least this wide.
const NARROWEST: usize = 25;

/// How the cells of a column stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Right,
    /// On the left, and in several lines where one has no room for them.
    Wrapped,
}

/// A text and how it stands out.
#[derive(Clone, Debug, Default)]
pub(super) struct Cell {
    pub(super) text: String,
    pub(super) style: Style,
    /// Whether it may reach over the cells to its right, which are empty.
    pub(super) reaches: bool,
}

impl From<String> for Cell {
    fn from(text: String) -> Cell {
        Cell { text, ..Cell::default() }
    }
}

impl Cell {
    pub(super) fn styled(text: impl Into<String>, style: Style) -> Cell {
        Cell { text: text.into(), style, reaches: false }
    }

    /// A remark that reaches over the cells to its right.
    pub(super) fn remark(text: impl Into<String>, style: Style) -> Cell {
        Cell { text: text.into(), style, reaches: true }
    }
}

/// A table with a title for each column.
pub(super) struct Table {
    titles: Vec<(&'static str, Align)>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    pub(super) fn new(titles: Vec<(&'static str, Align)>) -> Table {
        Table { titles, rows: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: Vec<Cell>) {
        self.rows.push(cells);
    }

    /// Writes the table, without columns that are empty everywhere.
    pub(super) fn write(&self, out: &mut dyn Write, title: Style) -> io::Result<()> {
        let widths = self.widths();
        let titles = self.titles.iter().map(|(text, _)| Cell::styled(*text, title));
        self.line(out, &titles.collect::<Vec<_>>(), &widths)?;
        for row in &self.rows {
            for line in self.lines(row, &widths) {
                self.line(out, &line, &widths)?;
            }
        }
        Ok(())
    }

    /// As wide as the cells, or narrower where these can be wrapped and the line has no room: the
    /// last column first.
    fn widths(&self) -> Vec<usize> {
        let mut widths: Vec<usize> =
            (0..self.titles.len()).map(|column| self.width(column)).collect();
        for (column, (_, align)) in self.titles.iter().enumerate().rev() {
            let excess = sum(&widths).saturating_sub(WIDTH);
            if let Some(width) = widths.get_mut(column).filter(|_| *align == Align::Wrapped) {
                *width = width.saturating_sub(excess).max(NARROWEST.min(*width));
            }
        }
        widths
    }

    /// The lines of a row: one, unless there are cells that have to be wrapped.
    fn lines(&self, row: &[Cell], widths: &[usize]) -> Vec<Vec<Cell>> {
        let mut lines = vec![row.to_vec()];
        for (column, cell) in row.iter().enumerate() {
            let is_wrapped = self.titles.get(column).is_some_and(|title| title.1 == Align::Wrapped);
            let width = match (cell.reaches, is_wrapped) {
                (true, _) => {
                    let before = sum(widths.get(..column).unwrap_or_default());
                    WIDTH.saturating_sub(before + 2).max(NARROWEST)
                }
                (false, true) => widths.get(column).copied().unwrap_or_default(),
                (false, false) => continue,
            };
            for (number, text) in wrapped(&cell.text, width).into_iter().enumerate() {
                if number == lines.len() {
                    lines.push(vec![Cell::default(); row.len()]);
                }
                if let Some(place) = lines.get_mut(number).and_then(|line| line.get_mut(column)) {
                    *place = Cell { text, ..cell.clone() };
                }
            }
        }
        lines
    }

    /// 0 if no row has anything there.
    fn width(&self, column: usize) -> usize {
        let cells = self.rows.iter().filter_map(|row| row.get(column));
        let cells = cells.filter(|cell| !cell.reaches);
        match cells.map(|cell| cell.text.width()).max() {
            Some(0) | None => 0,
            Some(width) => width.max(self.titles.get(column).map_or(0, |(title, _)| title.width())),
        }
    }

    fn line(&self, out: &mut dyn Write, cells: &[Cell], widths: &[usize]) -> io::Result<()> {
        let mut gap = 0;
        let shown = cells.iter().zip(&self.titles).zip(widths).filter(|(_, width)| **width > 0);
        for (number, ((cell, (_, align)), width)) in shown.enumerate() {
            let Cell { text, style, .. } = cell;
            let pad = width - text.width().min(*width);
            let before = if *align == Align::Right { pad } else { 0 };
            let between = if number == 0 { 0 } else { 2 };
            if !text.is_empty() {
                let indent = gap + between + before;
                write!(out, "{:indent$}{style}{text}{style:#}", "")?;
                gap = pad - before;
            } else {
                gap += between + width;
            }
        }
        writeln!(out)
    }
}

/// How wide columns are together.
fn sum(widths: &[usize]) -> usize {
    let shown = widths.iter().filter(|width| **width > 0);
    shown.map(|width| width + 2).sum::<usize>().saturating_sub(2)
}

/// A text in lines that are no wider than this, unless a word is.
pub(super) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words(text) {
        let Some(line) = lines.last_mut() else { break };
        if line.is_empty() {
            line.push_str(&word);
        } else if line.width() + 1 + word.width() <= width {
            line.push(' ');
            line.push_str(&word);
        } else {
            lines.push(word);
        }
    }
    lines
}

/// The words of a text. A number stays with its sign and its unit.
fn words(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let unit = word.trim_end_matches([',', ';', ')']);
        let is_unit = ["ms", "s", "min", "h", "d"].contains(&unit);
        match words.last_mut() {
            Some(last) if last == "±" || is_unit => *last = format!("{last} {word}"),
            _ => words.push(word.to_owned()),
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_fit_and_lines_end_without_blanks() {
        let mut table =
            Table::new(vec![("a", Align::Left), ("none", Align::Left), ("number", Align::Right)]);
        table.row(vec![Cell::from("é".to_owned()), Cell::default(), Cell::from("1".to_owned())]);
        table.row(vec![Cell::from("long".to_owned()), Cell::default(), Cell::default()]);
        table.row(vec![Cell::remark("a remark", Style::new()), Cell::default(), Cell::default()]);
        let mut out = Vec::new();
        table.write(&mut out, Style::new()).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "a     number\né          1\nlong\na remark\n");
    }

    #[test]
    fn sentences_are_wrapped_where_a_line_has_no_room_for_them() {
        let titles = vec![("a", Align::Left), ("b", Align::Wrapped), ("c", Align::Wrapped)];
        let mut table = Table::new(titles);
        let words = |count: usize| Cell::from(vec!["word"; count].join(" "));
        table.row(vec![Cell::from("name".to_owned()), words(3), words(15)]);
        table.row(vec![Cell::from("name".to_owned()), words(14), words(1)]);
        table.row(vec![Cell::default(), Cell::remark("remark ".repeat(20).trim(), Style::new())]);
        let mut out = Vec::new();
        table.write(&mut out, Style::new()).unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(text.lines().all(|line| line.width() <= WIDTH), "{text}");
        assert_eq!(text.matches("word").count(), 33);
        assert_eq!(text.matches("remark").count(), 20);
        assert_eq!(text.lines().count(), 1 + 3 + 2 + 2, "{text}");
    }
}
