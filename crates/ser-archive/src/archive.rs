//! The way in: opening an archive.

use std::path::Path;
use std::time::Duration;

use ser_evidence::record::Life;
use ser_evidence::time::{Moment, Utc};
use ser_proto::{Entry, Inputs};

use crate::batch::Bookmark;
use crate::error::{Error, Result, named};
use crate::place::Place;
use crate::schema::{self, About};
use crate::sql::{Columns, Sql, Value, first};
use crate::sqlite::Sqlite;
use crate::stored::stamp_of;

/// What an archive is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access<'p> {
    /// To read it. Several programs may do so, while another one writes.
    Read,
    /// To write to it as well. If there is none, it is made by this program, which says its name
    /// and version.
    Write {
        /// For people who have another version.
        program: &'p str,
    },
}

/// An archive.
pub struct Archive {
    pub(crate) sql: Box<dyn Sql>,
}

impl Archive {
    /// Opens the archive at this place.
    ///
    /// # Errors
    /// If it is no archive, another program is newer, or system or server do not let us.
    pub fn open(place: &Place, access: Access<'_>) -> Result<Archive> {
        match access {
            Access::Read => {
                let mut archive = Archive { sql: database(place, false)? };
                archive.about()?.fit_for_reading(archive.name())?;
                Ok(archive)
            }
            Access::Write { program } => {
                let mut archive = Archive { sql: database(place, true)? };
                archive.bring_up_to_date(program)?;
                Ok(archive)
            }
        }
    }

    /// Makes the tables, or adds to them what this program needs.
    fn bring_up_to_date(&mut self, program: &str) -> Result<()> {
        self.in_transaction(|archive| {
            let schema = match archive.sql.has_tables()? {
                false => 0,
                true => {
                    let about = archive.about()?;
                    about.fit_for_writing(archive.name())?;
                    about.schema
                }
            };
            if schema < schema::SCHEMA {
                archive.sql.migrate(schema)?;
                schema::note(&mut *archive.sql, program)?;
            }
            Ok(())
        })
    }

    fn about(&mut self) -> Result<About> {
        let about = schema::about(&mut *self.sql)?;
        about.ok_or_else(|| Error::damaged(self.name(), "it does not say what it is"))
    }

    /// Says how long this archive waits for others that write before it gives up with
    /// [`Error::Busy`]. Without a word it is ten seconds.
    ///
    /// # Errors
    /// If the server does not take it.
    pub fn set_patience(&mut self, patience: Duration) -> Result<()> {
        self.sql.set_patience(patience)
    }

    /// The archive's name, for messages.
    #[must_use]
    pub fn name(&self) -> &str {
        self.sql.name()
    }

    /// The position of the row that was added last; 0 if there is none.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn position(&mut self) -> Result<i64> {
        Ok(first(&mut *self.sql, "SELECT position FROM archive", &[], |row| row.int(0))?
            .unwrap_or(0))
    }

    /// When anything was added last, by the clock of the computer that did it; the latest, if that
    /// clock was set back since.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn last_added(&mut self) -> Result<Option<Moment<Utc>>> {
        const LAST: &str = "SELECT max(archived_us) FROM link";
        let last = first(&mut *self.sql, LAST, &[], |row| row.maybe_int(0))?.flatten();
        Ok(last.map(Moment::from_us))
    }

    /// Where a collector goes on reading a recorder; `None` if it never has.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub fn bookmark(&mut self, collector: &str, recorder: &str) -> Result<Option<Bookmark>> {
        const BOOKMARK: &str = "SELECT life, sequence, exact, log_size, stamp, changed, state, \
            log \
            FROM bookmark JOIN chain ON chain.id = bookmark.chain \
            JOIN recorder ON recorder.id = chain.recorder \
            WHERE chain.collector = ?1 AND recorder.name = ?2";
        let values = [Value::from(collector), Value::from(recorder)];
        first(&mut *self.sql, BOOKMARK, &values, |row| {
            Ok(Bookmark {
                life: Life::from_bits(row.int(0)?.cast_unsigned()),
                sequence: row.int(1)?.cast_unsigned(),
                is_exact: row.int(2)? != 0,
                log_size: row.maybe_int(3)?.and_then(|size| u16::try_from(size).ok()),
                anchor: anchor(row)?,
                log: row.bytes(7)?.try_into().ok(),
            })
        })
    }

    /// Copies the archive to a new file while others go on writing to it. The copy appears under
    /// its name when it is whole, and never takes the place of another file.
    ///
    /// # Errors
    /// If there is such a file, or the copy cannot be written.
    pub fn back_up(&mut self, to: &Path) -> Result<()> {
        let failed = |error: std::io::Error| match error.kind() {
            std::io::ErrorKind::StorageFull => Error::Full { archive: named(to) },
            _ => Error::Database { archive: named(to), source: Box::new(error) },
        };
        if to.exists() {
            return Err(failed(std::io::ErrorKind::AlreadyExists.into()));
        }
        let folder = to.parent().filter(|folder| !folder.as_os_str().is_empty());
        let half = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")));
        let half = half.map_err(failed)?;
        self.sql.copy_to(half.path())?;
        half.as_file().sync_all().map_err(failed)?;
        half.persist_noclobber(to).map_err(|error| failed(error.error))?;
        Ok(())
    }

    /// Does something, all of it or nothing.
    pub(crate) fn in_transaction<T>(
        &mut self,
        act: impl FnOnce(&mut Archive) -> Result<T>,
    ) -> Result<T> {
        self.sql.begin()?;
        let done = act(self).and_then(|done| self.sql.commit().map(|()| done));
        if done.is_err() {
            self.sql.roll_back();
        }
        done
    }

    /// Reads with several statements what was there at one moment. Otherwise what is added between
    /// them would be passed over, or contradict what was read before.
    pub(crate) fn in_snapshot<T>(
        &mut self,
        act: impl FnOnce(&mut Archive) -> Result<T>,
    ) -> Result<T> {
        self.sql.begin_reading()?;
        let done = act(self);
        self.sql.roll_back();
        done
    }
}

/// Opens what holds an archive.
fn database(place: &Place, is_for_writing: bool) -> Result<Box<dyn Sql>> {
    match place {
        Place::File(path) if is_for_writing => Ok(Box::new(Sqlite::open_to_write(path)?)),
        Place::File(path) => Ok(Box::new(Sqlite::open_to_read(path)?)),
        #[cfg(feature = "postgres")]
        Place::Postgres(address) => {
            Ok(Box::new(crate::postgres::Postgres::open(address, is_for_writing)?))
        }
        #[cfg(not(feature = "postgres"))]
        Place::Postgres(address) => Err(Error::Database {
            archive: address.clone(),
            source: "this program was built without PostgreSQL".into(),
        }),
    }
}

/// What a recorder's total counts modulo.
pub(crate) const WRAP: u64 = 1 << 16;

fn anchor(row: &dyn Columns) -> Result<Option<Entry>> {
    let mask = |column| -> Result<Option<Inputs>> {
        Ok(row.maybe_int(column)?.and_then(|mask| u32::try_from(mask).ok()).map(Inputs))
    };
    let (stamp, changed, state) = (row.maybe_int(4)?, mask(5)?, mask(6)?);
    Ok(stamp.zip(changed).zip(state).map(|((stamp, changed), state)| Entry {
        time: stamp_of(stamp),
        changed,
        state,
    }))
}
