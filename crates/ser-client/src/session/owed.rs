//! Late answers, which may still come although nobody waits for them.
//!
//! A new request of the same kind could take such an answer for its own. It is held back until the
//! answer has come, or its time is over.

use std::time::Duration;

use ser_proto::{Code, Command, Reply};

/// Requests whose late answers are remembered; beyond that the oldest are forgotten.
const MAX_REQUESTS: usize = 16;

/// Late answers to one request.
#[derive(Debug)]
struct Late {
    code: Code,
    /// The first entry that a read asked for.
    start: Option<u16>,
    replies: u32,
    until: Duration,
}

/// The late answers that may still come.
#[derive(Debug, Default)]
pub(super) struct Owed(Vec<Late>);

impl Owed {
    /// Remembers that up to `replies` answers to the command may still come before `until`.
    pub(super) fn remember(&mut self, command: &Command, replies: u32, until: Duration) {
        if replies == 0 {
            return;
        }
        if self.0.len() == MAX_REQUESTS {
            self.0.remove(0);
        }
        self.0.push(Late { code: command.code(), start: read_start(command), replies, until });
    }

    /// How long the command must be held back because a late answer could be taken for its own.
    pub(super) fn holds_back(&self, command: &Command) -> Option<Duration> {
        let (code, start) = (command.code(), read_start(command));
        self.0
            .iter()
            .filter(|late| late.code == code && late.start == start)
            .map(|late| late.until)
            .max()
    }

    /// Takes note of a reply that answers no request under way.
    pub(super) fn came(&mut self, reply: &Reply) {
        let start = match reply {
            Reply::Read(reply) => Some(reply.start),
            _ => None,
        };
        if let Some(late) =
            self.0.iter_mut().find(|late| late.code == reply.code() && late.start == start)
        {
            late.replies -= 1;
            self.0.retain(|late| late.replies > 0);
        }
    }

    /// Forgets answers whose time is over.
    pub(super) fn expire(&mut self, now: Duration) {
        self.0.retain(|late| now < late.until);
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }
}

const fn read_start(command: &Command) -> Option<u16> {
    match command {
        Command::Read { start, .. } => Some(*start),
        _ => None,
    }
}
