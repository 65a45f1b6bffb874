//! Entries that were read before their turn and wait until a reply proves them.

use std::collections::VecDeque;

use ser_proto::{Entry, Model};

/// The known entries of the events from the next one on. The reach of the requests bounds their
/// number.
#[derive(Debug, Default)]
pub(super) struct ReadAhead {
    /// In the order of the events, with holes; the last one is known.
    entries: VecDeque<Option<(Entry, Model)>>,
}

impl ReadAhead {
    /// Keeps the entry of the event at `offset` after the first.
    pub(super) fn keep(&mut self, offset: usize, entry: Entry, model: Model) {
        if self.entries.len() <= offset {
            self.entries.resize(offset + 1, None);
        }
        if let Some(known) = self.entries.get_mut(offset) {
            *known = Some((entry, model));
        }
    }

    /// Whether the entry of the event at `offset` after the first is known.
    pub(super) fn knows(&self, offset: u64) -> bool {
        let offset = usize::try_from(offset).unwrap_or(usize::MAX);
        matches!(self.entries.get(offset), Some(Some(_)))
    }

    /// Takes out the entry of the first event, if it is known. The next event then becomes the
    /// first.
    pub(super) fn pop(&mut self) -> Option<(Entry, Model)> {
        let known = self.entries.front().copied().flatten()?;
        self.entries.pop_front();
        Some(known)
    }

    /// How many events come before the first known one.
    pub(super) fn first_known(&self) -> Option<u64> {
        self.entries.iter().position(Option::is_some).map(|offset| offset as u64)
    }

    /// Whether no event is known.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Passes over `count` events.
    pub(super) fn skip(&mut self, count: u64) {
        let count = usize::try_from(count).unwrap_or(usize::MAX).min(self.entries.len());
        self.entries.drain(..count);
    }

    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }
}
