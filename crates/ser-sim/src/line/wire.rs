//! The wire from the host to the recorder. Bytes take their time on it.
//!
//! A client that sets the clock sends the time at which the last byte will arrive. On a
//! pseudo-terminal bytes would arrive at once, and the clock would be ahead by the duration of the
//! message.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u32 = 10;

/// Bytes that may be on the wire before the host has to wait.
const LIMIT: usize = 4096;

/// Bytes on their way, each with the moment at which its stop bit ends.
#[derive(Debug)]
pub(crate) struct Wire {
    takes_time: bool,
    bytes: VecDeque<(Instant, u8)>,
    free_from: Option<Instant>,
}

impl Wire {
    /// A wire that takes as long as the rate of its bytes says, where they have one.
    pub(crate) fn new() -> Wire {
        Wire { takes_time: true, bytes: VecDeque::new(), free_from: None }
    }

    /// A wire that takes no time.
    #[cfg(test)]
    pub(crate) fn without_delay() -> Wire {
        Wire { takes_time: false, ..Wire::new() }
    }

    /// How many more bytes the host may put on it.
    pub(crate) fn room(&self) -> usize {
        LIMIT.saturating_sub(self.bytes.len())
    }

    /// How many bytes are on it.
    pub(crate) fn waiting(&self) -> usize {
        self.bytes.len()
    }

    /// Puts bytes on the wire. They take their time at the given rate; without a rate they arrive
    /// at once.
    pub(crate) fn send(&mut self, now: Instant, bytes: &[u8], bits_per_second: Option<u32>) {
        let byte_time = match bits_per_second {
            Some(rate) if self.takes_time && rate > 0 => {
                Duration::from_secs(1) * BITS_PER_BYTE / rate
            }
            _ => Duration::ZERO,
        };
        let mut arrival = self.free_from.map_or(now, |free_from| free_from.max(now));
        for &byte in bytes {
            arrival += byte_time;
            self.bytes.push_back((arrival, byte));
        }
        self.free_from = Some(arrival);
    }

    /// The next byte, if it has arrived.
    pub(crate) fn receive(&mut self, now: Instant) -> Option<u8> {
        let &(arrival, byte) = self.bytes.front()?;
        if arrival > now {
            return None;
        }
        self.bytes.pop_front();
        Some(byte)
    }

    /// How long until the next byte arrives.
    pub(crate) fn next_arrival_in(&self, now: Instant) -> Option<Duration> {
        self.bytes.front().map(|(arrival, _)| arrival.saturating_duration_since(now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrived(wire: &mut Wire, now: Instant) -> Vec<u8> {
        std::iter::from_fn(|| wire.receive(now)).collect()
    }

    #[test]
    fn a_byte_at_300_baud_takes_33_milliseconds_and_the_next_one_follows_it() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut wire = Wire::new();
        wire.send(start, b"ab", Some(300));
        wire.send(at(1), b"c", Some(300));
        assert_eq!(arrived(&mut wire, at(33)), b"");
        assert_eq!(arrived(&mut wire, at(34)), b"a");
        assert_eq!(wire.next_arrival_in(at(66)), Some(Duration::from_nanos(666_666)));
        assert_eq!(arrived(&mut wire, at(101)), b"bc");
        assert_eq!(wire.next_arrival_in(at(101)), None);
    }

    #[test]
    fn without_a_rate_bytes_arrive_at_once() {
        let now = Instant::now();
        let mut wire = Wire::new();
        wire.send(now, b"abc", None);
        assert_eq!(arrived(&mut wire, now), b"abc");
    }
}
