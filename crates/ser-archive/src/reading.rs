//! Giving back what was kept.

use std::collections::BTreeMap;

use ser_evidence::record::Record;
use ser_evidence::time::{Moment, Shown};

use crate::archive::Archive;
use crate::error::Result;
use crate::sql::Value;
use crate::stored::{StoredEntry, StoredEvidence};

/// Which entries are wanted, by what the recorders' clocks showed. Entries whose stamp is no time
/// are in every window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The first moment; without it everything up to the last.
    pub from: Option<Moment<Shown>>,
    /// The last moment; without it everything from the first.
    pub until: Option<Moment<Shown>>,
}

/// A record, and where it is in the archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Archived {
    /// Positions rise in the order in which records were added.
    pub position: i64,
    /// Who has added it.
    pub collector: String,
    /// Whose record it is.
    pub recorder: String,
    /// What was read.
    pub record: Record,
}

/// The entries of a window. Two statements in one, since the index has no place at which a stamp is
/// either in the window or no time; and an order that no index has, since the one of all entries by
/// place would be taken for it.
const OF_WINDOW: &str = "SELECT * FROM (\
    SELECT life, sequence, number, stamp, shown_us, changed, state, known FROM entry \
    JOIN recorder ON recorder.id = entry.recorder \
    WHERE recorder.name = ?1 AND shown_us BETWEEN ?2 AND ?3 \
    UNION ALL \
    SELECT life, sequence, number, stamp, shown_us, changed, state, known FROM entry \
    JOIN recorder ON recorder.id = entry.recorder \
    WHERE recorder.name = ?1 AND shown_us IS NULL) AS wanted ORDER BY life + 0, sequence";

impl Archive {
    /// The recorders of which anything is kept, by name.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn recorders(&mut self) -> Result<Vec<String>> {
        let mut names = Vec::new();
        self.sql.query("SELECT name FROM recorder ORDER BY name", &[], &mut |row| {
            names.push(row.text(0)?.to_owned());
            Ok(())
        })?;
        Ok(names)
    }

    /// Gives everything that is known of a recorder besides entries to `on`, in the order of the
    /// archive, then the entries of a window with what contradicts them, by life and sequence.
    ///
    /// # Errors
    /// If the archive cannot be read, or `on` fails.
    pub fn read(
        &mut self,
        recorder: &str,
        window: Window,
        on: &mut dyn FnMut(&Record) -> Result<()>,
    ) -> Result<()> {
        self.in_snapshot(|archive| archive.read_now(recorder, window, on))
    }

    fn read_now(
        &mut self,
        recorder: &str,
        window: Window,
        on: &mut dyn FnMut(&Record) -> Result<()>,
    ) -> Result<()> {
        const EVIDENCE: &str = "SELECT position, line FROM evidence \
            JOIN recorder ON recorder.id = evidence.recorder \
            WHERE recorder.name = ?1 ORDER BY position";
        const ENTRIES: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM entry JOIN recorder ON recorder.id = entry.recorder \
            WHERE recorder.name = ?1 ORDER BY life, sequence";
        const CONFLICTS: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known FROM conflict JOIN recorder ON recorder.id = conflict.recorder \
            WHERE recorder.name = ?1 AND (shown_us BETWEEN ?2 AND ?3 OR shown_us IS NULL) \
            ORDER BY life, sequence, position";
        let archive = self.sql.name().to_owned();
        let name = Value::from(recorder);
        self.sql.query(EVIDENCE, std::slice::from_ref(&name), &mut |row| {
            on(&StoredEvidence::record(row.text(1)?, row.int(0)?, &archive)?)
        })?;
        let from = window.from.map_or(i64::MIN, Moment::us);
        let until = window.until.map_or(i64::MAX, Moment::us);
        let values = [name, Value::Int(from), Value::Int(until)];
        let (entries, of_entries) = match window {
            Window { from: None, until: None } => (ENTRIES, &values[..1]),
            _ => (OF_WINDOW, &values[..]),
        };
        for (statement, values) in [(entries, of_entries), (CONFLICTS, &values[..])] {
            self.sql.query(statement, values, &mut |row| {
                on(&Record::Entry(StoredEntry::from_row(row, 0, &archive)?.record()))
            })?;
        }
        Ok(())
    }

    /// The next records after a position, at most so many, in the order in which they were added.
    /// Who remembers the position of the last one goes on there, and misses nothing.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn since(&mut self, position: i64, limit: u32) -> Result<Vec<Archived>> {
        self.in_snapshot(|archive| archive.since_now(position, limit))
    }

    fn since_now(&mut self, position: i64, limit: u32) -> Result<Vec<Archived>> {
        const ENTRIES: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known, position, recorder.name, collector FROM entry \
            JOIN recorder ON recorder.id = entry.recorder JOIN chain ON chain.id = entry.chain \
            WHERE position > ?1 ORDER BY position LIMIT ?2";
        const CONFLICTS: &str = "SELECT life, sequence, number, stamp, shown_us, changed, state, \
            known, position, recorder.name, collector FROM conflict \
            JOIN recorder ON recorder.id = conflict.recorder \
            JOIN chain ON chain.id = conflict.chain WHERE position > ?1 ORDER BY position LIMIT ?2";
        const EVIDENCE: &str = "SELECT position, line, recorder.name, collector FROM evidence \
            JOIN recorder ON recorder.id = evidence.recorder \
            JOIN chain ON chain.id = evidence.chain WHERE position > ?1 ORDER BY position LIMIT ?2";
        let archive = self.sql.name().to_owned();
        let values = [Value::Int(position), Value::Int(limit.into())];
        let mut found: BTreeMap<i64, Archived> = BTreeMap::new();
        for statement in [ENTRIES, CONFLICTS] {
            self.sql.query(statement, &values, &mut |row| {
                let record = Record::Entry(StoredEntry::from_row(row, 0, &archive)?.record());
                let (position, recorder) = (row.int(8)?, row.text(9)?.to_owned());
                let collector = row.text(10)?.to_owned();
                found.insert(position, Archived { position, collector, recorder, record });
                Ok(())
            })?;
        }
        self.sql.query(EVIDENCE, &values, &mut |row| {
            let (position, recorder) = (row.int(0)?, row.text(2)?.to_owned());
            let record = StoredEvidence::record(row.text(1)?, position, &archive)?;
            let collector = row.text(3)?.to_owned();
            found.insert(position, Archived { position, collector, recorder, record });
            Ok(())
        })?;
        let limit = usize::try_from(limit).unwrap_or(usize::MAX);
        Ok(found.into_values().take(limit).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::OF_WINDOW;

    #[test]
    fn a_window_is_found_by_an_index_and_not_among_all_entries() {
        let connection = rusqlite::Connection::open_in_memory().unwrap();
        connection.execute_batch(include_str!("../migrations/sqlite/0001_first.sql")).unwrap();
        let mut plan = connection.prepare(&format!("EXPLAIN QUERY PLAN {OF_WINDOW}")).unwrap();
        let steps = plan.query_map(("SER1", 1, 2), |row| row.get::<_, String>(3)).unwrap();
        let of_entries: Vec<String> =
            steps.map(Result::unwrap).filter(|step| step.contains(" entry ")).collect();
        let by = |condition| format!("SEARCH entry USING INDEX entry_by_shown ({condition})");
        let expected =
            [by("recorder=? AND shown_us>? AND shown_us<?"), by("recorder=? AND shown_us=?")];
        assert_eq!(of_entries, expected);
    }
}
