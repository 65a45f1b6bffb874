//! What is in an archive: its tables as docs/archive.md describes them, read without any code of the
//! project.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags, Row};

/// A row of `entry`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Entry {
    pub(crate) recorder: String,
    pub(crate) life: i64,
    pub(crate) sequence: i64,
    pub(crate) number: i64,
    pub(crate) stamp: i64,
    pub(crate) changed: i64,
    pub(crate) state: i64,
    pub(crate) known: i64,
}

/// A row of `evidence`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Evidence {
    pub(crate) recorder: String,
    pub(crate) kind: String,
    pub(crate) life: i64,
    pub(crate) line: String,
}

/// A row of `bookmark`, as its life is filed.
#[derive(Clone, Debug)]
pub(crate) struct Bookmark {
    pub(crate) collector: String,
    pub(crate) recorder: String,
    pub(crate) life: i64,
    pub(crate) sequence: i64,
}

/// What is in an archive.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    pub(crate) entries: Vec<Entry>,
    pub(crate) evidence: Vec<Evidence>,
    pub(crate) bookmarks: Vec<Bookmark>,
    pub(crate) conflicts: i64,
}

const ENTRIES: &str = "SELECT name, life, sequence, number, stamp, changed, state, known \
    FROM entry JOIN recorder ON recorder.id = entry.recorder ORDER BY name, life, sequence";

const EVIDENCE: &str = "SELECT name, kind, life, line FROM evidence \
    JOIN recorder ON recorder.id = evidence.recorder ORDER BY position";

/// Where a life is filed under another name, so is its bookmark.
const BOOKMARKS: &str = "SELECT collector, name, coalesce(joined, bookmark.life), \
    sequence + coalesce(shift, 0) FROM bookmark JOIN chain ON chain.id = bookmark.chain \
    JOIN recorder ON recorder.id = chain.recorder \
    LEFT JOIN alias ON alias.chain = bookmark.chain AND alias.life = bookmark.life";

const CONFLICTS: &str = "SELECT count(*) FROM conflict";

impl Tables {
    /// What is in a file at one moment.
    pub(crate) fn of_file(path: &Path) -> rusqlite::Result<Tables> {
        let mut file = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_WRITE)?;
        file.busy_timeout(Duration::from_secs(60))?;
        let moment = file.transaction()?;
        let text = |row: &Row<'_>, column| row.get::<_, String>(column);
        Ok(Tables {
            entries: all(&moment, ENTRIES, |row| {
                Ok(Entry {
                    recorder: text(row, 0)?,
                    life: row.get(1)?,
                    sequence: row.get(2)?,
                    number: row.get(3)?,
                    stamp: row.get(4)?,
                    changed: row.get(5)?,
                    state: row.get(6)?,
                    known: row.get(7)?,
                })
            })?,
            evidence: all(&moment, EVIDENCE, |row| {
                let (recorder, kind) = (text(row, 0)?, text(row, 1)?);
                Ok(Evidence { recorder, kind, life: row.get(2)?, line: text(row, 3)? })
            })?,
            bookmarks: all(&moment, BOOKMARKS, |row| {
                let (collector, recorder) = (text(row, 0)?, text(row, 1)?);
                Ok(Bookmark { collector, recorder, life: row.get(2)?, sequence: row.get(3)? })
            })?,
            conflicts: moment.query_row(CONFLICTS, (), |row| row.get(0))?,
        })
    }
}

#[cfg(feature = "postgres")]
/// The same of a database; `ask` gives the rows that a query has, with tabs between columns.
pub(crate) fn of_database(ask: impl Fn(&str) -> Option<Vec<Vec<String>>>) -> Option<Tables> {
    let number = |text: &String| text.parse::<i64>().expect("a number");
    let entry = |row: Vec<String>| Entry {
        recorder: row[0].clone(),
        life: number(&row[1]),
        sequence: number(&row[2]),
        number: number(&row[3]),
        stamp: number(&row[4]),
        changed: number(&row[5]),
        state: number(&row[6]),
        known: number(&row[7]),
    };
    let evidence = |row: Vec<String>| Evidence {
        recorder: row[0].clone(),
        kind: row[1].clone(),
        life: number(&row[2]),
        line: row[3].clone(),
    };
    let bookmark = |row: Vec<String>| Bookmark {
        collector: row[0].clone(),
        recorder: row[1].clone(),
        life: number(&row[2]),
        sequence: number(&row[3]),
    };
    Some(Tables {
        entries: ask(ENTRIES)?.into_iter().map(entry).collect(),
        evidence: ask(EVIDENCE)?.into_iter().map(evidence).collect(),
        bookmarks: ask(BOOKMARKS)?.into_iter().map(bookmark).collect(),
        conflicts: number(&ask(CONFLICTS)?[0][0]),
    })
}

fn all<T>(
    file: &Connection,
    query: &str,
    read: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
) -> rusqlite::Result<Vec<T>> {
    file.prepare(query)?.query_map((), read)?.collect()
}

/// A stamp in milliseconds since 1970 by the recorder's own clock; `None` if it is no date.
pub(crate) fn stamp_ms(stamp: i64) -> Option<i64> {
    let [year, month, day, hour, minute, second, high, low] = stamp.to_be_bytes();
    let year = if year < 70 { 2000 + i32::from(year) } else { 1900 + i32::from(year) };
    let date = chrono::NaiveDate::from_ymd_opt(year, month.into(), day.into())?;
    let ms = u16::from_be_bytes([high, low]);
    let time = date.and_hms_milli_opt(hour.into(), minute.into(), second.into(), ms.into())?;
    Some(time.and_utc().timestamp_millis())
}
