//! The tables, and what has become of them from version to version.
//!
//! A migration is never changed once an archive may have it; another one is added behind it.

use crate::error::{Error, Result};
use crate::sql::{Sql, Value, first};

/// The schema that this program writes.
pub(crate) const SCHEMA: i64 = 1;

/// The oldest schema whose programs can read what this one writes.
const READABLE_BY: i64 = 1;

/// What an archive says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct About {
    pub(crate) schema: i64,
    readable_by: i64,
    program: String,
}

/// What the archive says of itself; `None` if it has no tables yet.
pub(crate) fn about(sql: &mut dyn Sql) -> Result<Option<About>> {
    first(sql, "SELECT schema, readable_by, program FROM archive", &[], |row| {
        let (schema, readable_by) = (row.int(0)?, row.int(1)?);
        Ok(About { schema, readable_by, program: row.text(2)?.to_owned() })
    })
}

impl About {
    /// Refuses an archive that this program would read wrongly.
    pub(crate) fn fit_for_reading(&self, archive: &str) -> Result<()> {
        if self.readable_by <= SCHEMA { Ok(()) } else { Err(self.newer(archive)) }
    }

    /// Refuses an archive that this program would write wrongly.
    pub(crate) fn fit_for_writing(&self, archive: &str) -> Result<()> {
        if self.schema <= SCHEMA { Ok(()) } else { Err(self.newer(archive)) }
    }

    fn newer(&self, archive: &str) -> Error {
        Error::Newer {
            archive: archive.to_owned(),
            program: self.program.clone(),
            schema: self.schema,
            known: SCHEMA,
        }
    }
}

/// Notes what the tables are now, and who made them so. The first time, nothing is in them.
pub(crate) fn note(sql: &mut dyn Sql, program: &str) -> Result<()> {
    const NOTE: &str = "INSERT INTO archive (one, schema, readable_by, program, position) \
        VALUES (1, ?1, ?2, ?3, 0) ON CONFLICT (one) DO UPDATE SET \
        schema = excluded.schema, readable_by = excluded.readable_by, program = excluded.program";
    let values = [Value::Int(SCHEMA), Value::Int(READABLE_BY), Value::from(program)];
    sql.run(NOTE, &values).map(|_| ())
}

#[cfg(test)]
mod tests {
    /// What each line of a migration is about: a table, an index, a column, a key.
    fn names(sql: &str) -> Vec<Vec<&str>> {
        let lines = sql.lines().filter(|line| !line.starts_with("--"));
        let words = lines.map(|line| {
            let count = if line.starts_with("CREATE") { 3 } else { 1 };
            line.trim_end_matches(" STRICT;").split_whitespace().take(count).collect()
        });
        words.filter(|words: &Vec<&str>| !words.is_empty() && !words[0].starts_with(')')).collect()
    }

    #[test]
    fn the_databases_have_the_same_tables_and_columns() {
        let file = names(include_str!("../migrations/sqlite/0001_first.sql"));
        assert_eq!(file, names(include_str!("../migrations/postgres/0001_first.sql")));
        assert!(file.len() > 50);
    }
}
