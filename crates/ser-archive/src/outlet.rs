//! Who is given what is archived, and how far that has got.
//!
//! Another archive, or a gateway to another system, gets every row in the order of its position. It
//! says when it has a row for good, and only then the outlet moves on: after any failure it is
//! given the rest again.

use crate::archive::Archive;
use crate::error::Result;
use crate::sql::{Value, first};

impl Archive {
    /// The position up to which this outlet has everything; 0 if it has nothing yet.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn outlet(&mut self, name: &str) -> Result<i64> {
        const POSITION: &str = "SELECT position FROM outlet WHERE name = ?1";
        let position = first(&mut *self.sql, POSITION, &[Value::from(name)], |row| row.int(0))?;
        Ok(position.unwrap_or(0))
    }

    /// Notes that an outlet has everything up to a position. It never moves back. From its first
    /// note on, retention lets nothing go that it does not have.
    ///
    /// # Errors
    /// If the archive cannot be written.
    pub fn set_outlet(&mut self, name: &str, position: i64) -> Result<()> {
        const SET: &str = "INSERT INTO outlet (name, position) VALUES (?1, ?2) \
            ON CONFLICT (name) DO UPDATE SET position = excluded.position \
            WHERE excluded.position > outlet.position";
        self.in_transaction(|archive| {
            archive.sql.run(SET, &[Value::from(name), Value::Int(position)]).map(|_| ())
        })
    }

    /// Forgets an outlet, so that retention waits for it no longer. Returns whether there was one.
    ///
    /// # Errors
    /// If the archive cannot be written.
    pub fn forget_outlet(&mut self, name: &str) -> Result<bool> {
        const FORGET: &str = "DELETE FROM outlet WHERE name = ?1";
        self.in_transaction(|archive| Ok(archive.sql.run(FORGET, &[Value::from(name)])? > 0))
    }

    /// All outlets by name, and how far each is.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn outlets(&mut self) -> Result<Vec<(String, i64)>> {
        let mut outlets = Vec::new();
        self.sql.query("SELECT name, position FROM outlet ORDER BY name", &[], &mut |row| {
            outlets.push((row.text(0)?.to_owned(), row.int(1)?));
            Ok(())
        })?;
        Ok(outlets)
    }

    /// The position up to which all outlets have everything; `None` if there is no outlet.
    pub(crate) fn safe_elsewhere(&mut self) -> Result<Option<i64>> {
        const LAST: &str = "SELECT min(position) FROM outlet";
        Ok(first(&mut *self.sql, LAST, &[], |row| row.maybe_int(0))?.flatten())
    }
}
