//! How each recorder is, for whoever wants to know.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Whether a recorder is being read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reached {
    /// Nobody has tried yet.
    #[default]
    NotYet,
    /// It is being read.
    Yes,
    /// It is not.
    No,
    /// It was read once, as was wanted.
    Done,
}

/// How a recorder is.
#[derive(Clone, Debug)]
pub struct State {
    /// Its name.
    pub recorder: String,
    /// Whether it is being read.
    pub reached: Reached,
    /// Why not, and what to try.
    pub trouble: Option<(String, Option<String>)>,
    /// Entries that were archived in this run and had not been there.
    pub entries: u64,
    /// Losses that were told in this run.
    pub gaps: u64,
    /// Entries that contradict others in the archive.
    pub conflicts: u64,
    /// When its thread was last seen at work.
    pub seen_at: Instant,
}

/// The states of all recorders.
#[derive(Clone, Debug, Default)]
pub(crate) struct States(Arc<Mutex<Vec<State>>>);

impl States {
    pub(crate) fn of(recorders: impl Iterator<Item = String>) -> States {
        let state = |recorder| State {
            recorder,
            reached: Reached::NotYet,
            trouble: None,
            entries: 0,
            gaps: 0,
            conflicts: 0,
            seen_at: Instant::now(),
        };
        States(Arc::new(Mutex::new(recorders.map(state).collect())))
    }

    /// Changes the state of the recorder at this place of the list.
    pub(crate) fn change(&self, place: usize, change: impl FnOnce(&mut State)) {
        let mut states = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(state) = states.get_mut(place) {
            change(state);
            state.seen_at = Instant::now();
        }
    }

    pub(crate) fn all(&self) -> Vec<State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
