//! Requests whose replies have not come, and what each of them is for.

use std::collections::VecDeque;
use std::ops::Range;

use crate::reading::read_request::ReadRequest;

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The last slots of the ring, or those after the head: which of them hold an entry?
    Probe,
    /// Events from the next one on, without an anchor.
    Plain,
    /// Events from this index on. They are kept until a reply has shown the anchor.
    Events(u64),
    /// Whatever these slots hold by then, because events come faster than they can be read.
    Overrun,
    /// Nothing any more, because the log has begun anew.
    Abandoned,
}

/// A request whose reply has not come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) request: ReadRequest,
    pub(super) purpose: Purpose,
}

impl Asked {
    /// The events that are asked for, if they are asked for by index.
    pub(super) fn events(&self) -> Option<Range<u64>> {
        match self.purpose {
            Purpose::Events(first) => Some(first..first + u64::from(self.request.count)),
            _ => None,
        }
    }
}

/// Requests in the order in which they were made.
#[derive(Debug, Default)]
pub(super) struct Outstanding(VecDeque<Asked>);

impl Outstanding {
    /// Adds a request, unless its reply could be taken for that to another one: only the first
    /// entry tells replies apart.
    pub(super) fn add(&mut self, asked: Asked) -> Option<ReadRequest> {
        if self.0.iter().any(|other| other.request.start == asked.request.start) {
            return None;
        }
        self.0.push_back(asked);
        Some(asked.request)
    }

    /// Takes out the request that a reply with this first entry belongs to.
    pub(super) fn take(&mut self, start: u16) -> Option<Asked> {
        let place = self.0.iter().position(|asked| asked.request.start == start)?;
        self.0.remove(place)
    }

    /// Makes all requests meaningless. Their replies are still to come.
    pub(super) fn abandon(&mut self) {
        self.0.iter_mut().for_each(|asked| asked.purpose = Purpose::Abandoned);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &Asked> {
        self.0.iter()
    }

    /// Whether one of the first `requests` asks for an event.
    pub(super) fn asks_for(&self, index: u64, requests: usize) -> bool {
        let has_it = |asked: &Asked| asked.events().is_some_and(|events| events.contains(&index));
        self.0.iter().take(requests).any(has_it)
    }
}
