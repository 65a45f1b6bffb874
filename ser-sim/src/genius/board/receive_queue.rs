//! Datagrams that wait for a Read Datagram command (chapter 10).

use std::collections::VecDeque;

use super::Board;
use super::interrupts::Condition;
use crate::genius::datagram::Datagram;

/// One more than these is lost.
const LEN: usize = 15;

#[derive(Clone, Debug)]
pub(super) struct Received {
    pub(super) from: u8,
    pub(super) broadcast: bool,
    pub(super) datagram: Datagram,
}

#[derive(Clone, Debug, Default)]
pub(super) struct ReceiveQueue(VecDeque<Received>);

impl ReceiveQueue {
    pub(super) fn pop(&mut self) -> Option<Received> {
        self.0.pop_front()
    }
}

impl Board {
    /// Neither sender nor host learns of a datagram that finds the queue full.
    pub(super) fn queue_received(&mut self, from: u8, broadcast: bool, datagram: Datagram) {
        if self.live.received.0.len() < LEN {
            self.live.received.0.push_back(Received { from, broadcast, datagram });
            self.raise(Condition::ReceiveQueue);
        }
    }
}
