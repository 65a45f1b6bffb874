//! Meeting a recorder: is it the one that it should be, and does it still have the log that was
//! read?

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ser_archive::Bookmark;
use ser_client::Unit;
use ser_evidence::record::{Life, LifeRecord, Record, Suppressed};
use ser_observer::{LogIdentity, life_of_recorder, new_life};
use ser_proto::{Configuration, Model};

use super::Task;
use super::audit::Unfiled;
use crate::trouble::Trouble;

/// For how long a recorder is taken for an original one without being asked.
const BELIEVED_FOR: Duration = Duration::from_secs(30 * 86_400);

/// What a thread remembers from visit to visit.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// When it was found to be an original recorder.
    original_since: Option<Instant>,
    /// Whether entries have shown that there is another log now.
    pub(super) is_of_another_log: bool,
    /// What was last archived of the life.
    pub(super) life: Option<LifeRecord>,
    /// What its filters had left out.
    pub(super) left_out: Option<Suppressed>,
    /// Commands that could not be archived yet.
    pub(super) unfiled: Unfiled,
    /// What was learnt besides entries, and may be of another recorder.
    pub(super) unproven: Vec<Record>,
    /// Which log the recorder said that it has when that was learnt.
    pub(super) unproven_of: Option<LogIdentity>,
    /// When its clock is to be set next, in microseconds of UTC.
    pub(super) set_due: Option<i64>,
    /// The settings that it had when it was first met.
    pub(super) found: Option<Configuration>,
    /// Whether its auto report was switched since.
    pub(super) has_switched: bool,
    /// What is still to be archived of that.
    pub(super) unsaid: Vec<Record>,
}

/// Which recorder has which number.
#[derive(Debug, Default)]
pub(crate) struct Known(Mutex<BTreeMap<[u8; 12], String>>);

impl Known {
    /// Notes that this recorder is there under this name. What was there before is known still: it
    /// may answer at another port now.
    pub(crate) fn note(&self, log: &LogIdentity, recorder: &str) {
        if let Some(id) = log.recorder() {
            let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            known.insert(id, recorder.to_owned());
        }
    }

    /// The other recorder that this is.
    fn other(&self, log: &LogIdentity, recorder: &str) -> Option<String> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(&log.recorder()?).filter(|name| *name != recorder).cloned()
    }
}

/// A recorder that was met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    /// Which log it says that it has; `None` from an original one.
    pub(super) log: Option<LogIdentity>,
    /// Whether that is another log than the one at the bookmark.
    pub(super) is_another: bool,
    /// How the life is called that begins with this visit.
    pub(super) new_life: Life,
    /// Whether everybody gives that name.
    pub(super) is_told: bool,
    /// Its model, if it says so or the site file does.
    pub(super) model: Option<Model>,
}

impl Task {
    /// Asks which log this is before it is read.
    pub(super) fn meet(
        &self,
        unit: &mut Unit,
        bookmark: Option<&Bookmark>,
        memory: &mut Memory,
    ) -> Result<Met, Trouble> {
        let is_believed = memory.original_since.is_some_and(|at| at.elapsed() < BELIEVED_FOR);
        if self.recorder.is_original || is_believed {
            unit.take_for_original();
        }
        let identity = unit.identity()?;
        let name = &self.recorder.name;
        let is_moved = self.shared.options.moved.contains(name);
        let Some(identity) = identity else {
            let has_said = bookmark.is_some_and(|bookmark| bookmark.log.is_some());
            if has_said && !self.recorder.is_original && !is_moved {
                return Err(Trouble::Nameless);
            }
            // On a line that has failed meanwhile, every recorder is silent.
            unit.log_position()?;
            memory.original_since = memory.original_since.or(Some(Instant::now()));
            let (is_another, new_life) = (false, draw()?);
            let model = self.recorder.model;
            return Ok(Met { log: None, is_another, new_life, is_told: false, model });
        };
        memory.original_since = None;
        let log = LogIdentity::from(&identity);
        if let Some(other) = self.shared.known.other(&log, name)
            && !is_moved
        {
            return Err(Trouble::Elsewhere { other });
        }
        self.shared.known.note(&log, name);
        let read = bookmark.and_then(|bookmark| bookmark.log).map(LogIdentity::from_bytes);
        let is_another = memory.is_of_another_log || read.is_some_and(|read| read != log);
        let told = match is_another || bookmark.is_none() {
            true => life_of_recorder(unit, &identity)?,
            false => None,
        };
        let (is_told, model) = (told.is_some(), Some(identity.model));
        let new_life = told.map_or_else(draw, Ok)?;
        Ok(Met { log: Some(log), is_another, new_life, is_told, model })
    }
}

/// A name for a life that nobody else knows.
pub(super) fn draw() -> Result<Life, Trouble> {
    new_life().map_err(Trouble::NoRandom)
}
