//! Requests of other devices to read or write the host's memory (chapter 13).
//!
//! The manual does not describe the header in front of a request's data on the bus. Here it is
//! length and address as in the queue, and `ser-proto` lays these datagrams out in the same way.
//! The header has no room for an auxiliary source address, so that is 0.

use super::Board;
use super::interrupts::Condition;
use super::reason::Reason;
use super::violations::ViolationKind;
use crate::genius::datagram::{Datagram, MessagePriority, subfunction};
use crate::genius::device::Message;
use crate::genius::map::{REQUEST_HEAD, REQUEST_LEN, REQUEST_QUEUE, REQUEST_TAIL, REQUESTS};

// Offsets within a buffer:
const STATUS: usize = 1;
const LENGTH: usize = 2;
const SOURCE: usize = 6;
const DATA: usize = 8;
const DATA_LEN: usize = 128;

const COMPLETE: u8 = 1;
const BUSY: u8 = 2;
const ERRORS: u8 = 4 | 8;

/// Length of the header in front of a memory access datagram's data.
const HEADER_LEN: usize = 4;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RequestQueue {
    /// The next buffer the host will release.
    head: usize,
    /// The next buffer to fill.
    tail: usize,
    /// The host wrote the tail pointer, and the board does not survive that.
    hung: bool,
    /// When the board looks at the head pointer.
    pub(super) look_us: Option<u64>,
}

/// Whether a datagram wants to access memory.
pub(super) fn is_memory_access(datagram: &Datagram) -> bool {
    use subfunction::{READ_DEVICE, WRITE_DEVICE, WRITE_POINT};
    [READ_DEVICE, WRITE_DEVICE, WRITE_POINT].into_iter().any(|code| datagram.is(code))
}

impl Board {
    /// Queues a request. Neither sender nor host learns of one that finds the queue full.
    pub(super) fn queue_request(&mut self, from: u8, datagram: &Datagram) {
        let mut header = [0; HEADER_LEN];
        let header_len = datagram.data.len().min(HEADER_LEN);
        header[..header_len].copy_from_slice(&datagram.data[..header_len]);
        let mut buffer = [0; REQUEST_LEN];
        buffer[0] = datagram.subfunction;
        buffer[LENGTH..SOURCE].copy_from_slice(&header);
        buffer[SOURCE] = from;
        let data = &datagram.data[header_len..];
        let data_len = data.len().min(DATA_LEN);
        buffer[DATA..DATA + data_len].copy_from_slice(&data[..data_len]);
        self.append_request(&buffer);
    }

    fn append_request(&mut self, buffer: &[u8; REQUEST_LEN]) {
        let RequestQueue { head, tail, hung, .. } = self.live.requests;
        let next = (tail + 1) % REQUESTS;
        if hung || next == head {
            return;
        }
        self.ram.write(REQUEST_QUEUE + tail * REQUEST_LEN, buffer);
        self.live.requests.tail = next;
        #[expect(clippy::cast_possible_truncation, reason = "below 16")]
        self.ram.set(REQUEST_TAIL, next as u8);
        self.raise(Condition::RequestQueue);
    }

    pub(super) fn hang_request_queue(&mut self) {
        self.live.requests.hung = true;
    }

    /// Does what the released buffers say. The host has moved the head pointer.
    pub(super) fn look_at_requests(&mut self) {
        self.live.requests.look_us = None;
        let RequestQueue { head, tail, hung, .. } = self.live.requests;
        let new_head = usize::from(self.ram.get(REQUEST_HEAD));
        if hung {
            return;
        }
        let waiting = (tail + REQUESTS - head) % REQUESTS;
        let released = (new_head + REQUESTS - head) % REQUESTS;
        if new_head >= REQUESTS || released > waiting {
            return self.violations.note(self.now_us, ViolationKind::RequestQueue, REQUEST_HEAD);
        }
        for _ in 0..released {
            self.release_request();
        }
    }

    fn release_request(&mut self) {
        let at = REQUEST_QUEUE + self.live.requests.head * REQUEST_LEN;
        let mut buffer = [0; REQUEST_LEN];
        buffer.copy_from_slice(self.ram.read(at, REQUEST_LEN));
        let status = std::mem::take(&mut buffer[STATUS]);
        self.ram.set(at + STATUS, 0);
        self.live.requests.head = (self.live.requests.head + 1) % REQUESTS;
        if status & ERRORS != 0 {
            // Nothing happens, and the device that asked gets no answer.
        } else if status & BUSY != 0 {
            self.append_request(&buffer);
        } else if status & COMPLETE == 0 {
            self.violations.note(self.now_us, ViolationKind::RequestQueue, at + STATUS);
        } else if buffer[0] == subfunction::READ_DEVICE {
            self.send_read_device_reply(&buffer);
        }
    }

    fn send_read_device_reply(&mut self, buffer: &[u8; REQUEST_LEN]) {
        let data_len = usize::from(buffer[LENGTH]).min(DATA_LEN);
        let data = [&buffer[LENGTH..SOURCE], &buffer[DATA..DATA + data_len]].concat();
        let datagram = Datagram::standard(subfunction::READ_DEVICE_REPLY, data);
        let message = Message::Datagram { to: buffer[SOURCE], datagram };
        self.live.outbox.push(MessagePriority::Normal, message, Reason::Reply);
    }
}
