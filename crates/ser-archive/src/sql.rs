//! What a database must do for an archive. Statements are the same for all of them, with `?1` and so
//! on for their values.

use std::path::Path;
use std::time::Duration;

use crate::error::Result;

/// A value of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    /// Nothing.
    Null,
    /// A number. Names of 64 bits are their bits.
    Int(i64),
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

impl From<i64> for Value {
    fn from(value: i64) -> Value {
        Value::Int(value)
    }
}

impl From<Option<i64>> for Value {
    fn from(value: Option<i64>) -> Value {
        value.map_or(Value::Null, Value::Int)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Value {
        Value::Text(value.to_owned())
    }
}

impl From<&[u8]> for Value {
    fn from(value: &[u8]) -> Value {
        Value::Bytes(value.to_owned())
    }
}

#[cfg(feature = "postgres")]
impl Value {
    /// The number, if it is one.
    pub(crate) const fn as_int(&self) -> Option<i64> {
        if let Value::Int(value) = self { Some(*value) } else { None }
    }

    /// The text, if it is one.
    pub(crate) fn as_text(&self) -> Option<&str> {
        if let Value::Text(value) = self { Some(value) } else { None }
    }

    /// The bytes, if it is some.
    pub(crate) fn as_bytes(&self) -> Option<&[u8]> {
        if let Value::Bytes(value) = self { Some(value) } else { None }
    }
}

/// The columns of a row. A column of another type than is asked for is damage.
pub(crate) trait Columns {
    /// The number in this column, from 0.
    fn int(&self, column: usize) -> Result<i64>;
    /// The number, if there is one.
    fn maybe_int(&self, column: usize) -> Result<Option<i64>>;
    /// The text.
    fn text(&self, column: usize) -> Result<&str>;
    /// The bytes.
    fn bytes(&self, column: usize) -> Result<&[u8]>;
}

/// What is done with each row.
pub(crate) type OnRow<'f> = &'f mut dyn FnMut(&dyn Columns) -> Result<()>;

/// A database.
pub(crate) trait Sql: Send {
    /// Its name, for messages.
    fn name(&self) -> &str;

    /// How long a writer waits for another one from now on.
    fn set_patience(&mut self, patience: Duration) -> Result<()>;

    /// Whether there are tables of ours.
    fn has_tables(&mut self) -> Result<bool>;

    /// Goes through the steps that an archive of this schema has not gone through; 0 has none.
    fn migrate(&mut self, schema: i64) -> Result<()>;

    /// Copies everything to an empty file.
    fn copy_to(&mut self, path: &Path) -> Result<()>;

    /// Begins a transaction in which nobody else writes.
    fn begin(&mut self) -> Result<()>;

    /// Begins a transaction that sees what is there now, whatever others write meanwhile.
    fn begin_reading(&mut self) -> Result<()>;

    /// Ends the transaction; what was written is there to stay.
    fn commit(&mut self) -> Result<()>;

    /// Ends the transaction as if nothing had been written.
    fn roll_back(&mut self);

    /// Runs a statement and returns how many rows it has changed.
    fn run(&mut self, sql: &'static str, values: &[Value]) -> Result<u64>;

    /// Runs a statement once for each row of values.
    fn run_each(&mut self, sql: &'static str, rows: &[Vec<Value>]) -> Result<()> {
        rows.iter().try_for_each(|values| self.run(sql, values).map(|_| ()))
    }

    /// Gives every row of an answer to `on`.
    fn query(&mut self, sql: &'static str, values: &[Value], on: OnRow<'_>) -> Result<()>;

    /// How much room it takes, in bytes.
    fn size(&mut self) -> Result<u64>;

    /// About how much of that is evidence, which retention never lets go.
    fn evidence_size(&mut self) -> Result<u64>;

    /// Gives back to the system what deleted rows took, where that takes doing.
    fn give_back(&mut self) -> Result<()>;
}

/// The first row of an answer, as `take` sees it.
pub(crate) fn first<T>(
    sql: &mut dyn Sql,
    statement: &'static str,
    values: &[Value],
    take: impl Fn(&dyn Columns) -> Result<T>,
) -> Result<Option<T>> {
    let mut found = None;
    sql.query(statement, values, &mut |row| {
        if found.is_none() {
            found = Some(take(row)?);
        }
        Ok(())
    })?;
    Ok(found)
}
