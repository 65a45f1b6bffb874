//! An archive in a database of `PostgreSQL`, for many collectors and readers.
//!
//! Everything is in a schema of its own, `ser_archive`. One transaction writes at a time, so positions
//! become visible in their order, and who reads on from a position misses nothing.

mod login;
mod tls;

use std::collections::HashMap;
use std::path::Path;
use std::time::Duration;

use futures_util::TryStreamExt;
use tokio::runtime::{Builder, Runtime};
use tokio_postgres::error::SqlState;
use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Client, Statement};

use crate::error::{Error, Result};
use crate::sql::{Columns, OnRow, Sql, Value};

/// The steps from nothing to the newest schema.
const MIGRATIONS: [&str; 1] = [include_str!("../../migrations/postgres/0001_first.sql")];

/// What is set in every connection: how long to wait for another writer, what names mean, and that a
/// transaction that has ended is on the disk, whatever user or database have as their default.
const SETTINGS: &str = "SET search_path = ser_archive; SET lock_timeout = '10s'; \
    SET client_min_messages = warning; SET idle_in_transaction_session_timeout = '60s'; \
    SELECT set_config('synchronous_commit', 'on', false) \
    WHERE current_setting('synchronous_commit') = 'off'";

/// The oldest server with everything that is used here, as `server_version_num`.
const OLDEST_SERVER: i32 = 150_000;

/// How many rows are sent at once.
const ROWS_AT_ONCE: usize = 5000;

/// A connection.
pub(crate) struct Postgres {
    runtime: Runtime,
    client: Client,
    name: String,
    /// By their text: those that were prepared, and their rewritten forms.
    statements: HashMap<&'static str, Statement>,
    many: HashMap<&'static str, Statement>,
    is_for_writing: bool,
}

impl Postgres {
    /// Connects to read, or to write as well.
    pub(crate) fn open(address: &str, is_for_writing: bool) -> Result<Postgres> {
        if tokio::runtime::Handle::try_current().is_ok() {
            return Err(Error::Database {
                archive: address.to_owned(),
                source: "an archive in PostgreSQL is not used within an async runtime: give it a \
                         thread of its own"
                    .into(),
            });
        }
        let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| {
            Error::Database { archive: address.to_owned(), source: error.into() }
        })?;
        let login = login::Login::of(address)?;
        let client = runtime.block_on(login.connect())?;
        let (statements, many) = (HashMap::new(), HashMap::new());
        let name = address.to_owned();
        let mut opened = Postgres { runtime, client, name, statements, many, is_for_writing };
        opened.batch(SETTINGS)?;
        opened.fit_server()?;
        if !is_for_writing {
            opened.batch("SET default_transaction_read_only = on")?;
        }
        Ok(opened)
    }

    /// Refuses a server that is too old.
    fn fit_server(&mut self) -> Result<()> {
        let mut version = 0;
        self.query("SELECT current_setting('server_version_num')::bigint", &[], &mut |row| {
            version = i32::try_from(row.int(0)?).unwrap_or(i32::MAX);
            Ok(())
        })?;
        if version >= OLDEST_SERVER {
            return Ok(());
        }
        let (major, needed) = (version / 10_000, OLDEST_SERVER / 10_000);
        Err(Error::Database {
            archive: self.name.clone(),
            source: format!("the server is PostgreSQL {major}, and {needed} is needed").into(),
        })
    }

    fn batch(&self, sql: &str) -> Result<()> {
        let done = self.runtime.block_on(self.client.batch_execute(sql));
        done.map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &tokio_postgres::Error) -> Error {
        failed_later(&self.name, error)
    }

    /// The number that a statement answers; 0 if it is none.
    fn number(&mut self, sql: &'static str) -> Result<u64> {
        let mut number = 0;
        self.query(sql, &[], &mut |row| {
            number = u64::try_from(row.int(0)?).unwrap_or(0);
            Ok(())
        })?;
        Ok(number)
    }

    fn prepared(&mut self, sql: &'static str) -> Result<Statement> {
        if let Some(statement) = self.statements.get(sql) {
            return Ok(statement.clone());
        }
        let text = sql.replace('?', "$");
        let made = self.runtime.block_on(self.client.prepare(&text));
        let made = made.map_err(|error| self.failed(&error))?;
        self.statements.insert(sql, made.clone());
        Ok(made)
    }

    /// The form of an `INSERT` that takes a list for each column.
    fn prepared_for_many(&mut self, sql: &'static str, row: &[Value]) -> Result<Statement> {
        if let Some(statement) = self.many.get(sql) {
            return Ok(statement.clone());
        }
        let (insert, _) = sql.split_once(" VALUES ").unwrap_or((sql, ""));
        let lists: Vec<String> =
            (1..).zip(row).map(|(place, value)| format!("${place}::{}[]", kind(value))).collect();
        let text = format!("{insert} SELECT * FROM unnest({})", lists.join(", "));
        let made = self.runtime.block_on(self.client.prepare(&text));
        let made = made.map_err(|error| self.failed(&error))?;
        self.many.insert(sql, made.clone());
        Ok(made)
    }

    fn insert_many(&mut self, sql: &'static str, rows: &[Vec<Value>]) -> Result<()> {
        let Some(first) = rows.first() else { return Ok(()) };
        let statement = self.prepared_for_many(sql, first)?;
        let columns: Vec<Column<'_>> =
            (0..first.len()).map(|column| Column::of(rows, column)).collect();
        let values: Vec<&(dyn ToSql + Sync)> = columns.iter().map(Column::as_sql).collect();
        let done = self.runtime.block_on(self.client.execute(&statement, &values));
        done.map(|_| ()).map_err(|error| self.failed(&error))
    }
}

/// What a value is called. All columns that may hold nothing are numbers.
const fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null | Value::Int(_) => "bigint",
        Value::Text(_) => "text",
        Value::Bytes(_) => "bytea",
    }
}

/// All values of a column.
enum Column<'r> {
    Ints(Vec<Option<i64>>),
    Texts(Vec<Option<&'r str>>),
    Bytes(Vec<Option<&'r [u8]>>),
}

impl<'r> Column<'r> {
    fn of(rows: &'r [Vec<Value>], column: usize) -> Column<'r> {
        let values = || rows.iter().filter_map(|row| row.get(column));
        match values().next() {
            Some(Value::Text(_)) => Column::Texts(values().map(Value::as_text).collect()),
            Some(Value::Bytes(_)) => Column::Bytes(values().map(Value::as_bytes).collect()),
            _ => Column::Ints(values().map(Value::as_int).collect()),
        }
    }

    fn as_sql(&self) -> &(dyn ToSql + Sync) {
        match self {
            Column::Ints(values) => values,
            Column::Texts(values) => values,
            Column::Bytes(values) => values,
        }
    }
}

impl Sql for Postgres {
    fn name(&self) -> &str {
        &self.name
    }

    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        // To the server, none at all would mean for ever.
        let patience_ms = patience.as_millis().clamp(1, 1_000_000_000);
        self.batch(&format!("SET lock_timeout = '{patience_ms}ms'"))
    }

    fn has_tables(&mut self) -> Result<bool> {
        const TABLES: &str = "SELECT count(*) FROM information_schema.tables \
            WHERE table_schema = 'ser_archive' AND table_name = 'archive'";
        let mut found = 0;
        self.query(TABLES, &[], &mut |row| {
            found = row.int(0)?;
            Ok(())
        })?;
        Ok(found > 0)
    }

    fn migrate(&mut self, schema: i64) -> Result<()> {
        if schema == 0 {
            self.batch("CREATE SCHEMA IF NOT EXISTS ser_archive")?;
        }
        let done = usize::try_from(schema).unwrap_or(0);
        MIGRATIONS.iter().skip(done).try_for_each(|step| self.batch(step))
    }

    fn copy_to(&mut self, _path: &Path) -> Result<()> {
        Err(Error::Database {
            archive: self.name.clone(),
            source: "a database is backed up with pg_dump --schema ser_archive".into(),
        })
    }

    fn begin(&mut self) -> Result<()> {
        // Each statement must see what was committed before the lock was had.
        self.batch("BEGIN ISOLATION LEVEL READ COMMITTED")?;
        if !self.is_for_writing {
            return Ok(());
        }
        // By the name of the schema, so that nobody else means the same.
        let locked = self.batch("SELECT pg_advisory_xact_lock(hashtextextended('ser_archive', 0))");
        if locked.is_err() {
            self.roll_back();
        }
        locked
    }

    fn begin_reading(&mut self) -> Result<()> {
        // Whoever takes the rows may be slow.
        self.batch(
            "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY; \
             SET LOCAL idle_in_transaction_session_timeout = 0",
        )
    }

    fn commit(&mut self) -> Result<()> {
        self.batch("COMMIT")
    }

    fn roll_back(&mut self) {
        // Where the connection is gone, so is the transaction.
        _ = self.batch("ROLLBACK");
    }

    fn run(&mut self, sql: &'static str, values: &[Value]) -> Result<u64> {
        let statement = self.prepared(sql)?;
        let values: Vec<&(dyn ToSql + Sync)> =
            values.iter().map(|value| value as &(dyn ToSql + Sync)).collect();
        let done = self.runtime.block_on(self.client.execute(&statement, &values));
        done.map_err(|error| self.failed(&error))
    }

    fn run_each(&mut self, sql: &'static str, rows: &[Vec<Value>]) -> Result<()> {
        rows.chunks(ROWS_AT_ONCE).try_for_each(|rows| self.insert_many(sql, rows))
    }

    fn query(&mut self, sql: &'static str, values: &[Value], on: OnRow<'_>) -> Result<()> {
        let statement = self.prepared(sql)?;
        let name = self.name.as_str();
        self.runtime.block_on(async {
            let rows = self.client.query_raw(&statement, values).await;
            let rows = rows.map_err(|error| failed_later(name, &error))?;
            let mut rows = std::pin::pin!(rows);
            while let Some(row) =
                rows.try_next().await.map_err(|error| failed_later(name, &error))?
            {
                on(&Row { row: &row, name })?;
            }
            Ok(())
        })
    }

    fn size(&mut self) -> Result<u64> {
        // What tables take does not shrink when rows are deleted, so the rows are counted. An index
        // takes about as much again.
        const SIZE: &str = "SELECT (2 * (\
            (SELECT coalesce(sum(pg_column_size(entry.*)), 0) FROM entry) + \
            (SELECT coalesce(sum(pg_column_size(conflict.*)), 0) FROM conflict) + \
            (SELECT coalesce(sum(pg_column_size(link.*)), 0) FROM link) + \
            (SELECT coalesce(sum(pg_column_size(evidence.*)), 0) FROM evidence)))::bigint";
        self.number(SIZE)
    }

    fn evidence_size(&mut self) -> Result<u64> {
        const SIZE: &str = "SELECT coalesce(2 * sum(pg_column_size(evidence.*)), 0)::bigint \
            FROM evidence";
        self.number(SIZE)
    }

    fn give_back(&mut self) -> Result<()> {
        self.batch("VACUUM entry").and_then(|()| self.batch("VACUUM conflict"))
    }
}

impl ToSql for Value {
    fn to_sql(
        &self,
        kind: &Type,
        out: &mut bytes::BytesMut,
    ) -> std::result::Result<tokio_postgres::types::IsNull, Box<dyn std::error::Error + Sync + Send>>
    {
        match self {
            Value::Null => Ok(tokio_postgres::types::IsNull::Yes),
            Value::Int(value) => value.to_sql(kind, out),
            Value::Text(value) => value.to_sql(kind, out),
            Value::Bytes(value) => value.to_sql(kind, out),
        }
    }

    fn accepts(kind: &Type) -> bool {
        matches!(*kind, Type::INT8 | Type::TEXT | Type::BYTEA)
    }

    tokio_postgres::types::to_sql_checked!();
}

struct Row<'r> {
    row: &'r tokio_postgres::Row,
    name: &'r str,
}

impl Row<'_> {
    fn wrong(&self, column: usize, what: &str) -> Error {
        let name = self.row.columns().get(column).map_or("?", |column| column.name());
        Error::damaged(self.name, format!("column {name} holds no {what}"))
    }
}

impl Columns for Row<'_> {
    fn int(&self, column: usize) -> Result<i64> {
        self.maybe_int(column)?.ok_or_else(|| self.wrong(column, "number"))
    }

    fn maybe_int(&self, column: usize) -> Result<Option<i64>> {
        // A number that stands in the statement has half the size.
        let of_half =
            |_| self.row.try_get::<_, Option<i32>>(column).map(|half| half.map(i64::from));
        let found = self.row.try_get::<_, Option<i64>>(column).or_else(of_half);
        found.map_err(|_| self.wrong(column, "number"))
    }

    fn text(&self, column: usize) -> Result<&str> {
        self.row.try_get(column).map_err(|_| self.wrong(column, "text"))
    }

    fn bytes(&self, column: usize) -> Result<&[u8]> {
        self.row.try_get(column).map_err(|_| self.wrong(column, "bytes"))
    }
}

/// Why something failed for which there was a connection.
fn failed_later(name: &str, error: &tokio_postgres::Error) -> Error {
    match is_lost(error) {
        true => Error::Lost { archive: name.to_owned() },
        false => failed(name, error),
    }
}

/// Whether the connection is gone: it is closed, the system says that it does not work, or the server
/// has ended it.
fn is_lost(error: &tokio_postgres::Error) -> bool {
    let source = std::error::Error::source(error);
    let is_of_system = source.is_some_and(<dyn std::error::Error>::is::<std::io::Error>);
    let is_ended = matches!(
        error.code(),
        Some(
            &SqlState::ADMIN_SHUTDOWN
                | &SqlState::CRASH_SHUTDOWN
                | &SqlState::CANNOT_CONNECT_NOW
                | &SqlState::IDLE_IN_TRANSACTION_SESSION_TIMEOUT
        )
    );
    error.is_closed() || is_of_system || is_ended
}

fn failed(name: &str, error: &tokio_postgres::Error) -> Error {
    let archive = name.to_owned();
    match error.code() {
        Some(&SqlState::LOCK_NOT_AVAILABLE | &SqlState::T_R_DEADLOCK_DETECTED) => {
            Error::Busy { archive }
        }
        Some(&SqlState::DISK_FULL) => Error::Full { archive },
        Some(&SqlState::UNDEFINED_TABLE | &SqlState::INVALID_SCHEMA_NAME) => {
            Error::Missing { archive }
        }
        // The server's own words say more than what kind of error it is.
        _ => Error::Database { archive, source: said(error).into() },
    }
}

/// What went wrong, in the words of whoever says it.
fn said(error: &tokio_postgres::Error) -> String {
    let source = std::error::Error::source(error);
    match (error.as_db_error(), source) {
        (Some(said), _) => said.message().to_owned(),
        (None, Some(source)) => format!("{error}: {source}"),
        (None, None) => error.to_string(),
    }
}
