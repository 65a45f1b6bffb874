//! Answers that may still come although nobody waits for them any more.
//!
//! A new request of the same kind could take such an answer for its own. It is held back until the
//! answer has come, or its time is over.

use std::time::Duration;

use ser_proto::{Code, Command, Reply};

/// Requests whose late answers are remembered; of more the oldest are forgotten.
const MAX_REQUESTS: usize = 16;

/// Late answers to one request.
#[derive(Debug)]
struct Late {
    code: Code,
    /// Where a read began.
    start: Option<u16>,
    replies: u32,
    until: Duration,
}

/// What may still come.
#[derive(Debug, Default)]
pub(super) struct Owed(Vec<Late>);

impl Owed {
    /// So many answers to the command may come up to a moment.
    pub(super) fn remember(&mut self, command: &Command, replies: u32, until: Duration) {
        if replies == 0 {
            return;
        }
        if self.0.len() == MAX_REQUESTS {
            self.0.remove(0);
        }
        self.0.push(Late { code: command.code(), start: read_start(command), replies, until });
    }

    /// Until when the command has to be held back: an answer that may still come would pass for the
    /// one to it.
    pub(super) fn holds_back(&self, command: &Command) -> Option<Duration> {
        let (code, start) = (command.code(), read_start(command));
        self.0
            .iter()
            .filter(|late| late.code == code && late.start == start)
            .map(|late| late.until)
            .max()
    }

    /// A reply has come that answers no request under way.
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

    /// Nothing comes as late as that.
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
