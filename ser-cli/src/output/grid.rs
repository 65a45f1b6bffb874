//! A table for people: columns as wide as what is in them.

use std::io::{self, Write};

use unicode_width::UnicodeWidthStr;

use super::Palette;

/// A table, whose first row are the titles of its columns.
pub(crate) struct Grid {
    pub(crate) title: Option<String>,
    pub(crate) columns: Vec<&'static str>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Grid {
    /// Columns that are empty are left out.
    pub(crate) fn write(&self, out: &mut dyn Write, palette: Palette) -> io::Result<()> {
        if let Some(title) = &self.title {
            writeln!(out, "{title}")?;
        }
        let cell = |row: &[String], column: usize| row.get(column).map_or(0, |cell| cell.width());
        let widths: Vec<(usize, usize)> = (0..self.columns.len())
            .filter_map(|column| {
                let width = self.rows.iter().map(|row| cell(row, column)).max();
                let width = width.filter(|&width| width > 0)?;
                let title = self.columns.get(column).map_or(0, |title| title.width());
                Some((column, width.max(title)))
            })
            .collect();
        let titles: Vec<String> = self.columns.iter().map(|&title| title.to_owned()).collect();
        let style = palette.title;
        writeln!(out, "{style}{}{style:#}", line(&titles, &widths))?;
        self.rows.iter().try_for_each(|row| writeln!(out, "{}", line(row, &widths)))
    }
}

fn line(row: &[String], widths: &[(usize, usize)]) -> String {
    let mut line = String::new();
    for (column, width) in widths {
        let cell = row.get(*column).map_or("", String::as_str);
        line += cell;
        line.extend(std::iter::repeat_n(' ', (width + 2).saturating_sub(cell.width())));
    }
    line.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_letters() {
        let grid = Grid {
            title: None,
            columns: vec!["name", "empty", "on"],
            rows: vec![
                vec!["遮断器".to_owned(), String::new(), "入".to_owned()],
                vec!["52-1".to_owned(), String::new(), "x".to_owned()],
            ],
        };
        let mut out = Vec::new();
        grid.write(&mut out, Palette::plain()).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "name    on\n遮断器  入\n52-1    x\n");
    }
}
