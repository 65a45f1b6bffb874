//! Datagrams that wait for a Read Datagram command (chapter 10).

use std::collections::VecDeque;

use super::Board;
use super::interrupts::Condition;
use crate::genius::datagram::Datagram;

/// How many datagrams the queue holds. One more is lost.
const LEN: usize = 15;

#[derive(Clone, Debug)]
pub(super) struct QueuedDatagram {
    at_us: u64,
    pub(super) from: u8,
    pub(super) broadcast: bool,
    pub(super) datagram: Datagram,
}

/// The datagram in the read buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Read {
    /// How many datagrams have been read from the board, this one included.
    pub number: u64,
    /// When the board received it, in microseconds.
    pub arrived_us: u64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct ReceiveQueue {
    waiting: VecDeque<QueuedDatagram>,
    read: Option<Read>,
}

impl Board {
    /// Queues a datagram. Neither sender nor host learns of one that finds the queue full.
    pub(super) fn queue_received(&mut self, from: u8, broadcast: bool, datagram: Datagram) {
        if self.live.received.waiting.len() < LEN {
            let at_us = self.now_us;
            self.live.received.waiting.push_back(QueuedDatagram {
                at_us,
                from,
                broadcast,
                datagram,
            });
            self.raise(Condition::ReceiveQueue);
        }
    }

    /// Takes the oldest datagram for the read buffer.
    pub(super) fn take_received(&mut self) -> Option<QueuedDatagram> {
        let received = self.live.received.waiting.pop_front()?;
        self.reads += 1;
        self.live.received.read = Some(Read { number: self.reads, arrived_us: received.at_us });
        Some(received)
    }

    /// The datagram that was read last since the board was reset.
    #[must_use]
    pub fn latest_read(&self) -> Option<Read> {
        self.live.received.read
    }

    /// When the oldest unread datagram arrived, in microseconds.
    #[must_use]
    pub fn unread_since_us(&self) -> Option<u64> {
        self.live.received.waiting.front().map(|received| received.at_us)
    }
}
