//! Columns that are as wide as their widest cell.

use std::io::{self, Write};

use anstyle::Style;
use unicode_width::UnicodeWidthStr;

/// On which side of its column a cell stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Right,
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
        let widths: Vec<usize> = (0..self.titles.len()).map(|column| self.width(column)).collect();
        let titles = self.titles.iter().map(|(text, _)| Cell::styled(*text, title));
        self.line(out, &titles.collect::<Vec<_>>(), &widths)?;
        self.rows.iter().try_for_each(|row| self.line(out, row, &widths))
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
}
