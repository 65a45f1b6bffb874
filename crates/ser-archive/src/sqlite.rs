//! An archive in a file, by `SQLite`.
//!
//! Changes go to a log beside the file (WAL), so readers and the one writer do not wait for each
//! other. A transaction is on the disk when it ends (`synchronous = FULL`): what a recorder is told
//! to forget afterwards must not be lost by a power cut.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use rusqlite::backup::{Backup, StepResult};
use rusqlite::config::DbConfig;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, ErrorCode, OpenFlags, ToSql, params_from_iter};

use crate::error::{Error, Result, named};
use crate::sql::{Columns, OnRow, Sql, Value};

/// What is in the head of our files, so that nothing else is taken for one: `SERa`.
const APPLICATION_ID: i64 = 0x5345_5261;

/// How long a writer waits for another one, unless somebody says otherwise.
const PATIENCE: Duration = Duration::from_secs(10);

/// How soon it is tried again where `SQLite` does not wait by itself.
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// How many prepared statements are kept.
const STATEMENTS: usize = 64;

/// How far the log beside the file is cut back when nobody needs it, in bytes.
const LOG_LEFT: i64 = 64 << 20;

/// The steps from nothing to the newest schema.
const MIGRATIONS: [&str; 1] = [include_str!("../migrations/sqlite/0001_first.sql")];

/// A file.
pub(crate) struct Sqlite {
    connection: Connection,
    name: String,
}

impl Sqlite {
    /// Opens a file to read it. Nothing is made, and nothing is changed.
    pub(crate) fn open_to_read(path: &Path) -> Result<Sqlite> {
        // Without write access SQLite could not make the index of the log beside the file.
        let file = Sqlite::open(path, OpenFlags::SQLITE_OPEN_READ_WRITE)
            .or_else(|_| Sqlite::open(path, OpenFlags::SQLITE_OPEN_READ_ONLY))?;
        file.pragma("query_only", 1)?;
        match file.is_ours()? {
            true => Ok(file),
            false => Err(file.not_ours("it is empty")),
        }
    }

    /// Opens a file to write to it, or makes it.
    pub(crate) fn open_to_write(path: &Path) -> Result<Sqlite> {
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let file = Sqlite::open(path, flags)?;
        // Another program's file stays as it is.
        file.is_ours()?;
        file.keep_log(false)?;
        file.write_beside()?;
        file.pragma("synchronous", "FULL")?;
        file.pragma("foreign_keys", 1)?;
        file.pragma("journal_size_limit", LOG_LEFT)?;
        Ok(file)
    }

    fn open(path: &Path, flags: OpenFlags) -> Result<Sqlite> {
        let name = named(path);
        // To SQLite `:memory:` is no file, nor is what an address says that begins with `file:`.
        let path = std::path::absolute(path)
            .map_err(|error| Error::Database { archive: name.clone(), source: error.into() })?;
        let flags = flags | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let is_there = path.exists();
        let connection = Connection::open_with_flags(&path, flags).map_err(|error| match error
            .sqlite_error_code()
        {
            Some(ErrorCode::CannotOpen) if !is_there => Error::Missing { archive: name.clone() },
            _ => failed(&name, error),
        })?;
        connection.set_prepared_statement_cache_capacity(STATEMENTS);
        connection.busy_timeout(PATIENCE).map_err(|error| failed(&name, error))?;
        let opened = Sqlite { connection, name };
        opened.keep_log(true)?;
        Ok(opened)
    }

    /// Whether the log stays beside the file when nobody has it open any more. Who only reads
    /// leaves both as they are.
    fn keep_log(&self, is_kept: bool) -> Result<()> {
        let keep = DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE;
        let set = self.connection.set_db_config(keep, is_kept);
        set.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Lets changes go to the log beside the file. While another program does the same to a new
    /// file, `SQLite` does not wait by itself.
    fn write_beside(&self) -> Result<()> {
        let until = Instant::now() + PATIENCE;
        loop {
            match self.pragma("journal_mode", "WAL") {
                Err(Error::Busy { .. }) if Instant::now() < until => thread::sleep(LOOK_AGAIN),
                done => return done,
            }
        }
    }

    fn pragma(&self, pragma: &str, value: impl ToSql) -> Result<()> {
        // Some of them answer, and the answer is of no interest.
        let done = self.connection.pragma_update_and_check(None, pragma, value, |_| Ok(()));
        match done {
            Ok(()) | Err(rusqlite::Error::QueryReturnedNoRows) => Ok(()),
            Err(error) => Err(self.failed(error)),
        }
    }

    /// Whether this is an archive; a file without any table is none yet.
    fn is_ours(&self) -> Result<bool> {
        // Both at one moment: another program may be making the archive right now.
        const ABOUT: &str = "SELECT application_id, (SELECT count(*) FROM sqlite_schema) \
            FROM pragma_application_id";
        let both = |row: &rusqlite::Row<'_>| Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?));
        let about = self.connection.query_row(ABOUT, (), both);
        match about.map_err(|error| self.failed(error))? {
            (APPLICATION_ID, _) => self.has_only_tables().map(|()| true),
            (0, 0) => Ok(false),
            _ => Err(self.not_ours("it is a database of another program")),
        }
    }

    /// Refuses a file that brings statements of its own: they may take away what is added, or never
    /// end. No archive has any.
    fn has_only_tables(&self) -> Result<()> {
        const OTHERS: &str = "SELECT (SELECT count(*) FROM sqlite_schema \
            WHERE type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%') + \
            (SELECT count(*) FROM sqlite_schema AS made, pragma_table_xinfo(made.name) AS has \
            WHERE made.type = 'table' AND has.hidden > 0)";
        let others = self.connection.query_row(OTHERS, (), |row| row.get::<_, i64>(0));
        match others.map_err(|error| self.failed(error))? {
            0 => Ok(()),
            _ => Err(Error::damaged(&self.name, "somebody has put views or triggers into it")),
        }
    }

    fn not_ours(&self, what: &str) -> Error {
        Error::NotOurs { archive: self.name.clone(), what: what.to_owned() }
    }

    fn failed(&self, error: rusqlite::Error) -> Error {
        failed(&self.name, error)
    }
}

/// What a backup means by all.
const ALL_PAGES: std::ffi::c_int = -1;

impl Sql for Sqlite {
    fn name(&self) -> &str {
        &self.name
    }

    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        self.connection.busy_timeout(patience).map_err(|error| self.failed(error))
    }

    fn has_tables(&mut self) -> Result<bool> {
        self.is_ours()
    }

    fn migrate(&mut self, schema: i64) -> Result<()> {
        let done = usize::try_from(schema).unwrap_or(0);
        for step in MIGRATIONS.iter().skip(done) {
            self.connection.execute_batch(step).map_err(|error| self.failed(error))?;
        }
        self.pragma("application_id", APPLICATION_ID)
    }

    fn copy_to(&mut self, path: &Path) -> Result<()> {
        let mut copy = Sqlite::open(path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        // All at once: others may write meanwhile, but a copy in pieces begins anew when they do.
        let copied = Backup::new(&self.connection, &mut copy.connection)
            .and_then(|backup| backup.step(ALL_PAGES));
        match copied.map_err(|error| failed(&copy.name, error))? {
            StepResult::Done => Ok(()),
            _ => Err(Error::Busy { archive: self.name.clone() }),
        }
    }

    fn begin(&mut self) -> Result<()> {
        self.run("BEGIN IMMEDIATE", &[]).map(|_| ())
    }

    fn begin_reading(&mut self) -> Result<()> {
        self.run("BEGIN", &[]).map(|_| ())
    }

    fn commit(&mut self) -> Result<()> {
        self.run("COMMIT", &[]).map(|_| ())
    }

    fn roll_back(&mut self) {
        if !self.connection.is_autocommit() {
            // SQLite has rolled back itself if this fails.
            _ = self.run("ROLLBACK", &[]);
        }
    }

    fn run(&mut self, sql: &'static str, values: &[Value]) -> Result<u64> {
        let changed = self
            .connection
            .prepare_cached(sql)
            .and_then(|mut statement| statement.execute(params_from_iter(values)));
        changed.map(|changed| changed as u64).map_err(|error| self.failed(error))
    }

    fn run_each(&mut self, sql: &'static str, rows: &[Vec<Value>]) -> Result<()> {
        let done = self.connection.prepare_cached(sql).and_then(|mut statement| {
            rows.iter()
                .try_for_each(|values| statement.execute(params_from_iter(values)).map(|_| ()))
        });
        done.map_err(|error| self.failed(error))
    }

    fn query(&mut self, sql: &'static str, values: &[Value], on: OnRow<'_>) -> Result<()> {
        let mut statement =
            self.connection.prepare_cached(sql).map_err(|error| self.failed(error))?;
        let mut rows =
            statement.query(params_from_iter(values)).map_err(|error| self.failed(error))?;
        while let Some(row) = rows.next().map_err(|error| self.failed(error))? {
            on(&Row { row, name: &self.name })?;
        }
        Ok(())
    }

    fn size(&mut self) -> Result<u64> {
        let number = |sql| self.connection.query_row(sql, (), |row| row.get::<_, i64>(0));
        let size = number("PRAGMA page_count")
            .and_then(|all| Ok((all, number("PRAGMA freelist_count")?)))
            .and_then(|(all, free)| Ok((all - free) * number("PRAGMA page_size")?));
        size.map(|bytes| u64::try_from(bytes).unwrap_or(0)).map_err(|error| self.failed(error))
    }

    fn evidence_size(&mut self) -> Result<u64> {
        // The line, and what the other columns and the indexes take of a row.
        const SIZE: &str = "SELECT coalesce(sum(length(line) + 160), 0) FROM evidence";
        let size = self.connection.query_row(SIZE, (), |row| row.get::<_, i64>(0));
        size.map(|bytes| u64::try_from(bytes).unwrap_or(0)).map_err(|error| self.failed(error))
    }

    fn give_back(&mut self) -> Result<()> {
        // Pages that are free are used again, so the file stays as it is. Only its log shrinks.
        self.pragma("wal_checkpoint", "TRUNCATE")
    }
}

impl ToSql for Value {
    fn to_sql(&self) -> rusqlite::Result<rusqlite::types::ToSqlOutput<'_>> {
        Ok(rusqlite::types::ToSqlOutput::Borrowed(match self {
            Value::Null => ValueRef::Null,
            Value::Int(value) => ValueRef::Integer(*value),
            Value::Text(value) => ValueRef::Text(value.as_bytes()),
            Value::Bytes(value) => ValueRef::Blob(value),
        }))
    }
}

struct Row<'r> {
    row: &'r rusqlite::Row<'r>,
    name: &'r str,
}

impl Row<'_> {
    fn value(&self, column: usize) -> Result<ValueRef<'_>> {
        self.row.get_ref(column).map_err(|error| failed(self.name, error))
    }

    fn wrong(&self, column: usize, what: &str) -> Error {
        let name = self.row.as_ref().column_name(column).unwrap_or("?");
        Error::damaged(self.name, format!("column {name} holds no {what}"))
    }
}

impl Columns for Row<'_> {
    fn int(&self, column: usize) -> Result<i64> {
        self.maybe_int(column)?.ok_or_else(|| self.wrong(column, "number"))
    }

    fn maybe_int(&self, column: usize) -> Result<Option<i64>> {
        match self.value(column)? {
            ValueRef::Null => Ok(None),
            ValueRef::Integer(value) => Ok(Some(value)),
            _ => Err(self.wrong(column, "number")),
        }
    }

    fn text(&self, column: usize) -> Result<&str> {
        self.value(column)?.as_str().map_err(|_| self.wrong(column, "text"))
    }

    fn bytes(&self, column: usize) -> Result<&[u8]> {
        self.value(column)?.as_blob().map_err(|_| self.wrong(column, "bytes"))
    }
}

fn failed(name: &str, error: rusqlite::Error) -> Error {
    let archive = name.to_owned();
    match error.sqlite_error_code() {
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => Error::Busy { archive },
        Some(ErrorCode::DiskFull) => Error::Full { archive },
        Some(ErrorCode::NotADatabase) => {
            Error::NotOurs { archive, what: "it is no database".to_owned() }
        }
        Some(ErrorCode::DatabaseCorrupt) => Error::Damaged { archive, what: error.to_string() },
        _ => Error::Database { archive, source: Box::new(error) },
    }
}
