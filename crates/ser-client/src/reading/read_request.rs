//! Which entries to ask for.

use ser_proto::Command;

/// Entries to ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadRequest {
    /// Number of the first entry, from 1.
    pub start: u16,
    /// How many, 1–10.
    pub count: u8,
}

impl ReadRequest {
    /// Asks for the position of the log. The request includes one entry, because no manual promises
    /// an answer to a count of 0.
    pub const POSITION: ReadRequest = ReadRequest { start: 1, count: 1 };
}

impl From<ReadRequest> for Command {
    fn from(request: ReadRequest) -> Command {
        Command::Read { start: request.start, count: request.count }
    }
}
