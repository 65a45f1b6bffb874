//! What a spreadsheet holds, in a format that has the values themselves.

use std::collections::BTreeMap;

/// The cells of a sheet, by row and column.
pub(super) struct Sheet {
    columns: BTreeMap<String, u32>,
    rows: BTreeMap<u32, BTreeMap<u32, String>>,
}

/// A row after the first.
pub(super) struct Row<'s> {
    sheet: &'s Sheet,
    cells: &'s BTreeMap<u32, String>,
}

impl Sheet {
    /// Reads SYLK.
    pub(super) fn of(sylk: &str) -> Sheet {
        let mut rows: BTreeMap<u32, BTreeMap<u32, String>> = BTreeMap::new();
        for line in sylk.lines().filter_map(|line| line.strip_prefix("C;X")) {
            let (column, rest) = line.split_once(";Y").expect("a row");
            let (row, value) = rest.split_once(";K").expect("a value");
            let value = match value.strip_prefix('"') {
                Some(text) => text.rsplit_once('"').map_or(text, |(text, _)| text),
                // A formula follows the value that it has.
                None => value.split(";E").next().unwrap_or(value),
            };
            // A semicolon in a text is doubled.
            let value = value.replace(";;", ";");
            let (row, column) = (row.parse().expect("a row"), column.parse().expect("a column"));
            rows.entry(row).or_default().insert(column, value);
        }
        let first = rows.remove(&1).expect("a header");
        let columns = first.into_iter().map(|(column, name)| (name, column)).collect();
        Sheet { columns, rows }
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.values().map(|cells| Row { sheet: self, cells })
    }
}

impl Row<'_> {
    /// What is in a column, empty if nothing is.
    pub(super) fn text(&self, column: &str) -> String {
        let column = self.sheet.columns.get(column).expect("a column of this name");
        self.cells.get(column).cloned().unwrap_or_default()
    }
}
