//! What is missing between the events that are delivered.
//!
//! A loss is delivered with the event after it. If the reading ends first, the cursor has not
//! passed the loss, and the next reading finds it again.

use ser_proto::Entry;

use crate::reading::cursor::Cursor;
use crate::reading::delivery::{Delivery, Lost};

/// What was lost since the last delivery.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pending {
    restarted: bool,
    /// The log is read for the first time, from its beginning or from its oldest entry.
    begun: bool,
    /// How many events were overwritten before the log was first seen.
    at_least: u64,
    overwritten: u64,
}

/// The losses of a reading: those to deliver, and the counts of those delivered.
#[derive(Debug, Default)]
pub(super) struct Losses {
    pending: Pending,
    /// Events that are known to be lost.
    pub(super) lost: u32,
    /// How many times inputs had changed without being recorded.
    pub(super) unrecorded: u32,
    /// Whether the log began anew.
    pub(super) restarted: bool,
}

impl Losses {
    pub(super) fn is_pending(&self) -> bool {
        self.pending != Pending::default()
    }

    /// Notes that the log began anew. That is a loss only to a host that has read the log before
    /// it.
    pub(super) fn log_restarted(&mut self, was_read: bool) {
        // What was counted for the old log is meaningless.
        self.pending = Pending { restarted: was_read, ..Pending::default() };
    }

    /// Notes that the log is read for the first time, and that at least this many events were
    /// overwritten.
    pub(super) fn log_begun(&mut self, at_least: u64) {
        self.pending.begun = true;
        self.pending.at_least = at_least;
    }

    /// Notes that this many events were overwritten before they were read.
    pub(super) fn overwritten(&mut self, count: u64) {
        self.pending.overwritten += count;
    }

    /// Delivers what was lost since the event at the cursor.
    pub(super) fn deliver(&mut self, cursor: Option<Cursor>, on: &mut dyn FnMut(Delivery)) {
        let Pending { restarted, begun, at_least, overwritten } = std::mem::take(&mut self.pending);
        let last_read = cursor.map_or(0, |cursor| cursor.sequence);
        if restarted {
            self.restarted = true;
            on(Delivery::Lost { after: Some(last_read), lost: Lost::LogRestarted });
        }
        let after = Some(if begun { 0 } else { last_read });
        let count = u32::try_from(at_least + overwritten).unwrap_or(u32::MAX);
        self.lost = self.lost.saturating_add(count);
        if at_least > 0 {
            on(Delivery::Lost { after, lost: Lost::OverwrittenAtLeast { count } });
        } else if overwritten > 0 {
            on(Delivery::Lost { after, lost: Lost::Overwritten { count } });
        }
    }

    /// Delivers the inputs that changed without an entry between the event at the cursor and the
    /// next one, if the two are neighbours.
    pub(super) fn deliver_unrecorded(
        &mut self,
        cursor: Option<Cursor>,
        next: &Entry,
        on: &mut dyn FnMut(Delivery),
    ) {
        let Some(Cursor { sequence, anchor: Some(anchor), .. }) = cursor else { return };
        if !self.is_pending()
            && let Some(lost) = Lost::between(&anchor, next)
        {
            self.unrecorded = self.unrecorded.saturating_add(1);
            on(Delivery::Lost { after: Some(sequence), lost });
        }
    }
}
