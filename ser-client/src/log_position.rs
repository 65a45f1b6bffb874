//! Where a log stands.

use ser_proto::ReadReply;

use crate::Cursor;

/// Where the recorder will write next, and how much it has written: the header of every read reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LogPosition {
    /// Events since the last erase, modulo 65536.
    pub total: u16,
    /// The ring slot that the next event will get, from 0.
    pub next_slot: u16,
}

impl LogPosition {
    /// About how many events a reading from `cursor` would deliver from a log of `size` entries; for progress
    /// display. It is exact unless the log was erased, resized or still is filling for the first time.
    #[must_use]
    pub fn pending_since(&self, cursor: Option<&Cursor>, size: u16) -> u16 {
        cursor.map_or(self.total, |cursor| self.total.wrapping_sub(cursor.total)).min(size)
    }
}

impl From<&ReadReply> for LogPosition {
    fn from(reply: &ReadReply) -> LogPosition {
        LogPosition { total: reply.total, next_slot: reply.next_slot }
    }
}
