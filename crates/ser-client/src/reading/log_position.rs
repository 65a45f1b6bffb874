//! The position of a log.

use ser_proto::ReadReply;

/// Where the recorder will write next, and how much it has written: the header of every read reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LogPosition {
    /// Events since the last erase, modulo 65536.
    pub total: u16,
    /// The ring slot that the next event will get, from 0.
    pub next_slot: u16,
}

impl From<&ReadReply> for LogPosition {
    fn from(reply: &ReadReply) -> LogPosition {
        LogPosition { total: reply.total, next_slot: reply.next_slot }
    }
}
