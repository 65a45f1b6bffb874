//! The first request of a reading, which finds the position of the log and the anchor's place.

use ser_proto::MAX_SIZE;

use super::footing::Footing;
use super::head::{Head, index_after};
use super::progress::{Batch, Progress};
use super::requests::entries;
use crate::reading::cursor::Cursor;
use crate::reading::delivery::Delivery;
use crate::reading::disturbed::Disturbed;
use crate::reading::log_position::LogPosition;
use crate::reading::read_request::ReadRequest;

/// What a reading is given, and whether its first request is under way.
#[derive(Debug)]
pub(super) struct Locating {
    size: u64,
    pub(super) cursor: Option<Cursor>,
    /// Where the log stood at the end of the reading before.
    near: Option<LogPosition>,
    asked: Option<ReadRequest>,
    pub(super) keeps_up: bool,
    /// Whether this is known to be another log than the one at the cursor.
    pub(super) is_another_log: bool,
}

impl Locating {
    pub(super) fn new(cursor: Option<Cursor>, size: u16) -> Locating {
        let size = size.clamp(1, MAX_SIZE).into();
        Locating { size, cursor, near: None, asked: None, keeps_up: false, is_another_log: false }
    }

    /// Assumes that the log stands at a position or a little after it.
    pub(super) fn start_near(&mut self, position: LogPosition) {
        let in_ring = u64::from(position.next_slot) < self.size;
        if in_ring && self.cursor.is_some_and(|cursor| cursor.anchor.is_some()) {
            self.near = Some(position);
        }
    }

    /// The request, unless it is under way.
    pub(super) fn request(&mut self) -> Option<ReadRequest> {
        if self.asked.is_some() {
            return None;
        }
        // The probable slot of the last entry that was delivered.
        let last_slot = |near: LogPosition| (u64::from(near.next_slot) + self.size - 1) % self.size;
        let near = self.near.map(|near| entries(self.size, last_slot(near), 2));
        self.asked = Some(near.unwrap_or(ReadRequest::POSITION));
        self.asked
    }

    pub(super) const fn is_waiting(&self) -> bool {
        self.asked.is_some()
    }

    /// Takes out the request, if a reply with this first entry belongs to it.
    pub(super) fn take_asked(&mut self, start: u16) -> Option<ReadRequest> {
        self.asked.take_if(|asked| asked.start == start)
    }

    /// Takes the first header of the reading.
    pub(super) fn see_header(&self, position: LogPosition) -> Result<Progress, Disturbed> {
        let read_up_to = self.cursor.map_or(position.total.into(), |cursor| cursor.sequence);
        let next = index_after(read_up_to);
        let head = Head::first(position, self.size, next)?;
        let goes_on = |near: LogPosition| {
            let happened = u64::from(position.total.wrapping_sub(near.total));
            head.slot == (u64::from(near.next_slot) + happened) % self.size
        };
        if !self.near.is_none_or(goes_on) {
            return Err(Disturbed::Changed);
        }
        Ok(Progress::new(head, next, self.cursor, self.keeps_up))
    }

    /// Takes the entries of the first reply and finds what the reading stands on.
    pub(super) fn begin(
        &self,
        progress: &mut Progress,
        request: ReadRequest,
        batch: Batch<'_>,
        on: &mut dyn FnMut(Delivery),
    ) -> Result<(), Disturbed> {
        let Some(cursor) = self.cursor else { return Ok(()) };
        if self.is_another_log {
            progress.restart();
            return Ok(());
        }
        let Some(anchor) = cursor.anchor else {
            begin_without_anchor(progress, cursor, batch.entries.is_empty());
            return Ok(());
        };
        progress.footing = Footing::Anchor(anchor);
        let anchor_index = progress.next - 1;
        let anchor_number = progress.head.slot_of(anchor_index) + 1;
        if self.near.is_some() && u64::from(request.start) == anchor_number {
            return progress.take_events(anchor_index, request, batch, on);
        }
        Ok(())
    }
}

/// The log was empty at the last reading. The total then gives the number of entries, unless it has
/// wrapped. Total and next slot disagree if the ring has turned or was resized.
fn begin_without_anchor(progress: &mut Progress, cursor: Cursor, is_empty: bool) {
    progress.footing = Footing::Total;
    let behind = progress.behind();
    if cursor.total() == 0 && behind == 0 && !is_empty {
        progress.restart();
    } else if cursor.total() == 0 && behind < progress.head.size && !progress.head.holds_all() {
        progress.footing = Footing::Unknown;
    }
}
