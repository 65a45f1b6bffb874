//! Keeps the request queue moving (chapter 13), because a full queue loses requests silently.

use crate::counters::{Counters, count};
use crate::elapsed::elapsed_ms;
use crate::event::Event;
use crate::options::Requests;
use crate::ram::SharedRam;
use crate::request_queue::{
    AnswerError, Pointers, RequestAnswer, RequestStatus, finish, read_header, read_request,
    write_data,
};
use crate::timing;

/// The request that waits for an answer.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    index: u8,
    len: u8,
    since_ms: u32,
}

impl Waiting {
    /// Only the driver moves the head. A head that is elsewhere, or an empty queue, means that the
    /// board has started anew.
    fn is_still_there<R: SharedRam>(self, ram: &R) -> bool {
        Pointers::read(ram)
            .is_ok_and(|pointers| pointers.head == self.index && !pointers.is_empty())
    }
}

/// Handles requests one at a time.
#[derive(Debug)]
pub(super) struct RequestServer {
    due: bool,
    waiting: Option<Waiting>,
}

impl RequestServer {
    pub(super) const fn new() -> RequestServer {
        RequestServer { due: false, waiting: None }
    }

    pub(super) fn due(&mut self) {
        self.due = true;
    }

    pub(super) fn poll<R: SharedRam>(
        &mut self,
        ram: &mut R,
        now_ms: u32,
        policy: Requests,
        counters: &mut Counters,
    ) -> Option<Event> {
        if let Some(waiting) = self.waiting {
            if elapsed_ms(now_ms, waiting.since_ms) < timing::REQUEST_ANSWER_MS {
                return None;
            }
            self.waiting = None;
            count(&mut counters.requests_unanswered);
            return waiting.is_still_there(ram).then(|| refuse(ram, waiting.index, counters));
        }
        if !self.due {
            return None;
        }
        let Ok(pointers) = Pointers::read(ram) else {
            count(&mut counters.request_pointers_refused);
            self.due = false;
            return None;
        };
        if pointers.is_empty() {
            self.due = false;
            return None;
        }
        if pointers.is_full() {
            count(&mut counters.request_queue_full);
        }
        let index = pointers.head;
        if policy == Requests::Refuse {
            return Some(refuse(ram, index, counters));
        }
        let Some(request) = read_request(ram, index) else {
            count(&mut counters.requests_malformed);
            return Some(refuse(ram, index, counters));
        };
        self.waiting = Some(Waiting { index, len: request.header.len, since_ms: now_ms });
        Some(Event::Request(request))
    }

    pub(super) fn answer<R: SharedRam>(
        &mut self,
        ram: &mut R,
        answer: RequestAnswer<'_>,
    ) -> Result<(), AnswerError> {
        let waiting = self.waiting.ok_or(AnswerError::NoRequest)?;
        if !waiting.is_still_there(ram) {
            self.waiting = None;
            return Err(AnswerError::NoRequest);
        }
        let status = match answer {
            RequestAnswer::Data(data) => {
                if data.len() != usize::from(waiting.len) {
                    return Err(AnswerError::WrongLength { expected: waiting.len });
                }
                write_data(ram, waiting.index, data);
                RequestStatus::Complete
            }
            RequestAnswer::Status(status) => status,
        };
        self.waiting = None;
        finish(ram, waiting.index, status);
        Ok(())
    }
}

/// Refuses a request because the host has no such memory.
fn refuse<R: SharedRam>(ram: &mut R, index: u8, counters: &mut Counters) -> Event {
    let header = read_header(ram, index);
    finish(ram, index, RequestStatus::Syntax);
    count(&mut counters.requests_refused);
    Event::RequestRefused(header)
}
