//! Keeps the state file up to date while events are delivered.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use ser_client::Cursor;

use crate::cli::ConnectionArgs;
use crate::connection;
use crate::error::Result;
use crate::output::{self, Life};
use crate::state::{Delivered, StateFile, StateLock};

/// How much a crash may repeat, in time: writing the file after every event would wear a memory card.
const SAVE_EVERY: Duration = Duration::from_secs(1);

/// Where what was delivered is remembered.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct StateArgs {
    /// Where to remember what was delivered; without it, the user's state directory (~/.local/state/ser-cli).
    ///
    /// A unit is the same however its port is spelled: by a relative path, a link, the device
    /// behind it, or by another name of this computer. A USB adapter that has a serial number is
    /// known by that (/dev/serial/by-id), not by the number that it gets when it is plugged in.
    #[arg(long, env = "SER_STATE_DIR", value_name = "DIR")]
    state_dir: Option<PathBuf>,
}

/// The state file of a unit, and what is to be written to it.
pub(crate) struct Keeper {
    file: StateFile,
    saved: Option<Delivered>,
    unsaved: Option<Delivered>,
    saved_at: Instant,
    /// Held until the end: two that read what is new would deliver it twice, or move the cursor back.
    _lock: StateLock,
}

impl Keeper {
    /// Loads what has been delivered from this unit.
    pub(crate) fn load(args: &StateArgs, connection: &ConnectionArgs) -> Result<Keeper> {
        let mut file = StateFile::of_unit(&connection::unit_name(connection)?, args.state_dir.as_deref())?;
        let lock = file.lock()?;
        let saved = file.load()?;
        Ok(Keeper { file, saved, unsaved: None, saved_at: Instant::now(), _lock: lock })
    }

    /// Where reading goes on.
    pub(crate) fn cursor(&self) -> Option<Cursor> {
        self.saved.map(|delivered| delivered.cursor)
    }

    /// The life of the log that was read; a new one where nothing is remembered.
    pub(crate) fn life(&self) -> Result<Life> {
        match self.saved.and_then(|delivered| delivered.life) {
            Some(life) => Ok(life),
            None => Ok(Life::begin()?),
        }
    }

    /// The size that the log had.
    pub(crate) fn size(&self) -> Option<u16> {
        self.saved.map(|delivered| delivered.size)
    }

    /// Everything up to `cursor`, in a log of this life, has reached standard output.
    pub(crate) fn delivered(&mut self, cursor: Option<Cursor>, size: u16, life: Life) -> Result<()> {
        let Some(cursor) = cursor else { return Ok(()) };
        let delivered = Delivered { cursor, size, life: Some(life) };
        self.unsaved = (self.saved != Some(delivered)).then_some(delivered);
        // The name of a new life must not get lost: the next run would give the same events another one.
        match self.saved {
            Some(saved) if saved.life == Some(life) => self.save_if_due(),
            _ => self.save(),
        }
    }

    /// Writes what is not written yet, unless that was done a moment ago.
    pub(crate) fn save_if_due(&mut self) -> Result<()> {
        if self.saved_at.elapsed() >= SAVE_EVERY { self.save() } else { Ok(()) }
    }

    /// Writes what is not written yet.
    pub(crate) fn save(&mut self) -> Result<()> {
        if let Some(delivered) = self.unsaved.take() {
            // The events have to be on the disk before it is remembered that they are: after a power cut it is better
            // to get some twice than to miss some.
            output::sync_stdout()?;
            self.file.save(&delivered)?;
            self.saved = Some(delivered);
            self.saved_at = Instant::now();
        }
        Ok(())
    }
}
