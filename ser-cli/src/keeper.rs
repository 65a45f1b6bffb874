//! Keeps the state file up to date while events are delivered.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ser_client::Cursor;
use ser_evidence::record::EntryRecord;
use ser_observer::{LogIdentity, new_life};

use crate::connection::{self, ConnectionArgs};
use crate::error::Result;
use crate::output::{self, Before, Life};
use crate::state::{Delivered, StateFile, StateLock};

/// How much a crash may repeat, as a time. Writing the file after every event would wear out a
/// memory card.
const SAVE_EVERY: Duration = Duration::from_secs(1);

/// The place where delivered events are remembered.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct StateArgs {
    /// Where to remember what was delivered and done to recorders; without it, the user's state
    /// directory (~/.local/state/ser-cli).
    ///
    /// A recorder is the same however its port is spelled: by a relative path, by a link, by the
    /// device behind it, or, on this computer, by localhost, 127.0.0.1 or `::1`. A USB adapter that
    /// has a serial number is known by that (/dev/serial/by-id), not by the number that it gets
    /// when it is plugged in. Numbers in /dev/pts are reused: name a simulated recorder by its
    /// link.
    #[arg(long, env = "SER_STATE_DIR", hide_env_values = true, value_name = "DIR")]
    state_dir: Option<PathBuf>,
}

impl StateArgs {
    /// Remembers in this directory.
    pub(crate) const fn in_directory(directory: PathBuf) -> StateArgs {
        StateArgs { state_dir: Some(directory) }
    }

    /// The directory, if the user wants another than the system's place for state.
    pub(crate) fn directory(&self) -> Option<&Path> {
        self.state_dir.as_deref()
    }
}

/// The entry of a recorder that was delivered last, if its life has a name, and if the recorder
/// does not say that its log is another one now.
pub(crate) fn last_delivered(
    args: &StateArgs,
    connection: &ConnectionArgs,
    log: Option<LogIdentity>,
) -> Option<EntryRecord> {
    let name = connection::unit_name(connection).ok()?;
    let delivered = StateFile::of_unit(&name, args.directory()).ok()?.load().ok()??;
    let cursor = delivered.cursor?;
    let is_another = delivered.log.zip(log).is_some_and(|(read, log)| read != log);
    if is_another {
        return None;
    }
    Some(EntryRecord {
        life: delivered.life?,
        sequence: Some(cursor.sequence),
        // Its place in the ring is not remembered.
        number: 0,
        entry: cursor.anchor?,
        known: EntryRecord::ALL_KNOWN,
    })
}

/// The state file of a recorder, and what is to be written to it.
pub(crate) struct Keeper {
    file: StateFile,
    saved: Option<Delivered>,
    unsaved: Option<Delivered>,
    saved_at: Instant,
    /// How the life of the log is called that begins with this run, if the recorder tells that.
    proposed: Option<Life>,
    /// Held until the end. Two runs that read new events at once would deliver them twice, or move
    /// the cursor back.
    _lock: StateLock,
}

impl Keeper {
    /// Loads what has been delivered from this recorder.
    pub(crate) fn load(args: &StateArgs, connection: &ConnectionArgs) -> Result<Keeper> {
        let mut file =
            StateFile::of_unit(&connection::unit_name(connection)?, args.state_dir.as_deref())?;
        let lock = file.lock()?;
        let saved = file.load()?;
        Ok(Keeper {
            file,
            saved,
            unsaved: None,
            saved_at: Instant::now(),
            proposed: None,
            _lock: lock,
        })
    }

    /// Where reading continues.
    pub(crate) fn cursor(&self) -> Option<Cursor> {
        self.saved.and_then(|delivered| delivered.cursor)
    }

    /// The life of the log that was read, and how far.
    pub(crate) fn place(&self) -> Option<(Life, Cursor)> {
        let saved = self.saved?;
        Some((saved.life?, saved.cursor?))
    }

    /// The life of the log that was read; a new one if nothing is remembered.
    pub(crate) fn life(&self) -> Result<Life> {
        match self.saved.and_then(|delivered| delivered.life) {
            Some(life) => Ok(life),
            None => Ok(self.proposed.map_or_else(new_life, Ok)?),
        }
    }

    /// Whether the log that was read has no name yet.
    pub(crate) fn has_no_life(&self) -> bool {
        self.saved.is_none_or(|delivered| delivered.life.is_none())
    }

    /// Whether a recorder that says this has another log than the one that was read. If nobody said
    /// anything of that one, only its entries tell.
    pub(crate) fn is_of_another_log(&self, log: LogIdentity) -> bool {
        let read = self.saved.filter(|delivered| delivered.cursor.is_some());
        read.and_then(|delivered| delivered.log).is_some_and(|read| read != log)
    }

    /// Says how a life is called that begins with this run. A name that was drawn before stays.
    pub(crate) fn propose(&mut self, name: Option<Life>) {
        self.proposed = name;
    }

    /// Notes which log it was that has been read up to the cursor.
    pub(crate) fn read_from(&mut self, log: LogIdentity) -> Result<()> {
        let Some(delivered) = self.unsaved.or(self.saved) else { return Ok(()) };
        if delivered.log != Some(log) {
            self.unsaved = Some(Delivered { log: Some(log), ..delivered });
        }
        self.save()
    }

    /// What else is known of the log.
    pub(crate) fn before(&self) -> Before {
        let Some(Delivered { cursor, next_life, erased, .. }) = self.saved else {
            return Before::default();
        };
        let next_life = next_life.or(self.proposed);
        Before { previous: cursor.and_then(|cursor| cursor.anchor).or(erased), erased, next_life }
    }

    /// The remembered size of the log.
    pub(crate) fn size(&self) -> Option<u16> {
        self.saved.map(|delivered| delivered.size).filter(|&size| size > 0)
    }

    /// Saves the name of a life before any of its events is passed on, because the next run must
    /// not give the same events another name.
    pub(crate) fn name(&mut self, life: Life, size: u16) -> Result<()> {
        let nothing =
            Delivered { cursor: None, size, life: None, next_life: None, erased: None, log: None };
        let known = self.unsaved.or(self.saved).unwrap_or(nothing);
        if [known.life, known.next_life].contains(&Some(life)) {
            return Ok(());
        }
        self.unsaved = Some(match known.cursor {
            Some(_) if known.life.is_some() => Delivered { next_life: Some(life), ..known },
            _ => Delivered { life: Some(life), ..known },
        });
        self.save()
    }

    /// Notes that everything up to `cursor`, in a log of this life, has reached standard output.
    pub(crate) fn delivered(
        &mut self,
        cursor: Option<Cursor>,
        size: u16,
        life: Life,
    ) -> Result<()> {
        if cursor.is_none() {
            return Ok(());
        }
        // The next event still has to continue from the last one of a log that was erased.
        let is_empty = cursor.is_some_and(|cursor| cursor.sequence == 0);
        let erased = self.saved.and_then(|saved| saved.erased).filter(|_| is_empty);
        // Whatever was said of the log was before the new entries.
        let is_where_it_was =
            |saved: &Delivered| (saved.cursor, saved.life) == (cursor, Some(life));
        let log = self.saved.filter(is_where_it_was).and_then(|saved| saved.log);
        let delivered = Delivered { cursor, size, life: Some(life), next_life: None, erased, log };
        self.unsaved = (self.saved != Some(delivered)).then_some(delivered);
        self.save_if_due()
    }

    /// The name of the life of a log that is empty now, as the recorder says that is this one. It
    /// is remembered for the entries to come.
    pub(crate) fn life_of_empty_log(&mut self, log: Option<LogIdentity>) -> Result<Life> {
        let is_another = log.is_some_and(|log| self.is_of_another_log(log));
        let size = self.size().unwrap_or(0);
        let known = self.unsaved.or(self.saved);
        match known {
            Some(Delivered {
                cursor: Some(Cursor { sequence: 0, .. }), life: Some(life), ..
            }) if !is_another => Ok(life),
            // There is another log now than the one that was read, and the next reading says so.
            Some(Delivered { cursor: Some(_), next_life, .. }) => {
                let life = next_life.or(self.proposed).map_or_else(new_life, Ok)?;
                self.name(life, size)?;
                Ok(life)
            }
            _ => {
                let life = known.and_then(|known| known.life).or(self.proposed);
                let life = life.map_or_else(new_life, Ok)?;
                let cursor = Some(Cursor { sequence: 0, is_exact: true, anchor: None });
                let next_life = None;
                let erased = None;
                self.unsaved =
                    Some(Delivered { cursor, size, life: Some(life), next_life, erased, log });
                self.save()?;
                Ok(life)
            }
        }
    }

    /// How many events of a log with this total have not been delivered. Also 0 if nobody reads new
    /// events.
    pub(crate) fn unread(&self, total: u16) -> u16 {
        self.cursor().map_or(0, |cursor| total.wrapping_sub(cursor.total()))
    }

    /// Notes that the log was erased, with its total at that time. If everything in it had been
    /// delivered, nothing is lost, and the next reading begins a new log. Returns whether that is
    /// so.
    pub(crate) fn erased(&mut self, total: u16) -> Result<bool> {
        let Some(cursor) = self.cursor() else { return Ok(false) };
        let is_whole = self.unread(total) == 0;
        if is_whole {
            let erased = cursor.anchor.or(self.saved.and_then(|saved| saved.erased));
            let cursor = Some(Cursor { sequence: 0, is_exact: true, anchor: None });
            let life = self.proposed.map_or_else(new_life, Ok)?;
            let (size, life) = (self.size().unwrap_or(0), Some(life));
            self.unsaved =
                Some(Delivered { cursor, size, life, next_life: None, erased, log: None });
            self.save()?;
        }
        Ok(is_whole)
    }

    /// Writes unsaved changes, unless that was done a moment ago.
    pub(crate) fn save_if_due(&mut self) -> Result<()> {
        if self.saved_at.elapsed() >= SAVE_EVERY { self.save() } else { Ok(()) }
    }

    /// Writes unsaved changes.
    pub(crate) fn save(&mut self) -> Result<()> {
        if let Some(delivered) = self.unsaved.take() {
            // The events must be on the disk before the file says so. After a power cut it is
            // better to get some twice than to miss some.
            output::sync_stdout()?;
            self.file.save(&delivered)?;
            self.saved = Some(delivered);
            self.saved_at = Instant::now();
        }
        Ok(())
    }
}
