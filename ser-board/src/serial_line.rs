//! The RS-232 line between the UART's interrupts and the main loop.
//!
//! A received byte keeps the tick at which it arrived, because the moment at which a command arrives matters to the
//! recorder (it may set the clock), however late the main loop looks. A byte that is lost leaves a mark on the next
//! one.

use core::sync::atomic::{AtomicU16, AtomicU32, Ordering};

use ser_proto::Baud;

use crate::ring::{Reader, Ring, Slot, Writer};

/// Bits of a character with start and stop bit.
pub const CHARACTER_BITS: u32 = 10;

/// A byte that has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Received {
    /// The byte.
    pub byte: u8,
    /// When, in milliseconds since power-up, wrapping.
    pub tick_ms: u32,
    /// At least one byte was lost around this one, before or after it: which of two a UART keeps is up to the UART.
    pub overrun: bool,
}

/// One received byte in a ring.
pub struct ReceivedCell {
    tick_ms: AtomicU32,
    /// The byte, and above it the overrun mark.
    byte: AtomicU16,
}

const OVERRUN: u16 = 1 << 8;

impl Slot for Received {
    type Cell = ReceivedCell;
    const EMPTY: ReceivedCell = ReceivedCell { tick_ms: AtomicU32::new(0), byte: AtomicU16::new(0) };

    #[inline]
    fn store(self, cell: &ReceivedCell) {
        cell.tick_ms.store(self.tick_ms, Ordering::Relaxed);
        let mark = if self.overrun { OVERRUN } else { 0 };
        cell.byte.store(u16::from(self.byte) | mark, Ordering::Relaxed);
    }

    #[inline]
    fn load(cell: &ReceivedCell) -> Received {
        let word = cell.byte.load(Ordering::Relaxed);
        let [byte, _] = word.to_le_bytes();
        Received { byte, tick_ms: cell.tick_ms.load(Ordering::Relaxed), overrun: word & OVERRUN != 0 }
    }
}

/// Memory of the rings of both directions; belongs into a static. See [`budget`](crate::budget) for the lengths.
pub struct SerialRings<const RECEIVE: usize, const TRANSMIT: usize> {
    receive: Ring<Received, RECEIVE>,
    transmit: Ring<u8, TRANSMIT>,
}

/// The four ends of [`SerialRings`].
pub struct SerialEnds<'a, const RECEIVE: usize, const TRANSMIT: usize> {
    /// The receive interrupt's.
    pub receiver: Receiver<'a, RECEIVE>,
    /// The main loop's end of what was received.
    pub received: Reader<'a, Received, RECEIVE>,
    /// The main loop's end of what is to be sent.
    pub to_send: Writer<'a, u8, TRANSMIT>,
    /// The transmit interrupt's.
    pub transmitter: Reader<'a, u8, TRANSMIT>,
}

impl<const RECEIVE: usize, const TRANSMIT: usize> SerialRings<RECEIVE, TRANSMIT> {
    /// Empty rings.
    #[must_use]
    pub const fn new() -> Self {
        SerialRings { receive: Ring::new(), transmit: Ring::new() }
    }

    /// The ends of both rings.
    pub fn split(&mut self) -> SerialEnds<'_, RECEIVE, TRANSMIT> {
        let (receiver, received) = self.receive.split();
        let (to_send, transmitter) = self.transmit.split();
        SerialEnds { receiver: Receiver { ring: receiver, lost: false }, received, to_send, transmitter }
    }
}

impl<const RECEIVE: usize, const TRANSMIT: usize> Default for SerialRings<RECEIVE, TRANSMIT> {
    fn default() -> Self {
        Self::new()
    }
}

/// The receive interrupt's end.
pub struct Receiver<'a, const N: usize> {
    ring: Writer<'a, Received, N>,
    /// A byte found no room; the next one that does carries the mark.
    lost: bool,
}

impl<const N: usize> Receiver<'_, N> {
    /// Whether another byte finds room. A UART that can keep bytes, or hold the other side back, is left alone until
    /// then.
    #[inline]
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.ring.has_room()
    }

    /// Takes a byte that the UART has. Without room it is lost, and the next one that finds room tells.
    #[inline]
    pub fn push(&mut self, received: Received) {
        let overrun = received.overrun | self.lost;
        self.lost = !self.ring.push(Received { overrun, ..received });
    }
}

/// Tells when everything sent has left the transmitter, for UARTs that say no more than that they have room.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet {
    /// Since when the transmitter has not been seen at work.
    since_ms: Option<u32>,
}

impl Quiet {
    /// The transmitter has not been looked at yet.
    #[must_use]
    pub const fn new() -> Quiet {
        Quiet { since_ms: None }
    }

    /// A byte has been put in line for the transmitter, which may have sent it before anybody looks again.
    pub const fn sent(&mut self) {
        self.since_ms = None;
    }

    /// Looks at the transmitter. `idle` says that no byte waits in the ring or in the UART's data register.
    ///
    /// True two characters' time after the first look that found it idle: one character may be in the shift register.
    /// Counts from looks and not from bytes, so however late it is asked, no character is cut short; but it has to be told
    /// of bytes that were [`sent`](Self::sent) in between.
    pub fn look(&mut self, idle: bool, now_ms: u32, baud: Baud) -> bool {
        if !idle {
            self.since_ms = None;
            return false;
        }
        let since_ms = *self.since_ms.get_or_insert(now_ms);
        now_ms.wrapping_sub(since_ms) > character_ms(baud, 2)
    }
}

/// How long so many characters take, in milliseconds, rounded up.
#[must_use]
pub const fn character_ms(baud: Baud, characters: u32) -> u32 {
    (characters * CHARACTER_BITS * 1000).div_ceil(baud.bits_per_second())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn byte(byte: u8, tick_ms: u32) -> Received {
        Received { byte, tick_ms, overrun: false }
    }

    #[test]
    fn a_byte_keeps_its_tick_and_its_mark() {
        let mut rings = SerialRings::<4, 4>::new();
        let mut ends = rings.split();
        let bytes = [byte(0x00, 0), byte(0xFF, u32::MAX), Received { overrun: true, ..byte(0xA5, 70_000) }];
        for received in bytes {
            ends.receiver.push(received);
        }
        assert_eq!(std::iter::from_fn(|| ends.received.pop()).collect::<Vec<_>>(), bytes);
    }

    #[test]
    fn the_byte_after_lost_ones_tells() {
        let mut rings = SerialRings::<2, 2>::new();
        let mut ends = rings.split();
        for tick_ms in 1..=4 {
            ends.receiver.push(byte(b'x', tick_ms));
        }
        assert!(!ends.receiver.has_room());
        assert_eq!((ends.received.pop(), ends.received.pop()), (Some(byte(b'x', 1)), Some(byte(b'x', 2))));
        ends.receiver.push(byte(b'y', 5));
        ends.receiver.push(byte(b'z', 6));
        assert_eq!(ends.received.pop(), Some(Received { overrun: true, ..byte(b'y', 5) }));
        assert_eq!(ends.received.pop(), Some(byte(b'z', 6)));
    }

    #[test]
    fn the_line_is_quiet_two_characters_after_it_was_first_seen_idle() {
        let mut quiet = Quiet::new();
        assert!(!quiet.look(false, 0, Baud::B19200));
        assert!(!quiet.look(true, 1000, Baud::B19200));
        // 20 bits at 19200 bit/s take 1.04 ms; the tick may have been about to end.
        assert!(!quiet.look(true, 1002, Baud::B19200));
        assert!(quiet.look(true, 1003, Baud::B19200));
        assert!(!quiet.look(false, 1004, Baud::B19200));
        assert!(!quiet.look(true, u32::MAX, Baud::B300));
        assert!(!quiet.look(true, 66, Baud::B300));
        assert!(quiet.look(true, 67, Baud::B300));
    }

    #[test]
    fn a_byte_that_came_and_went_between_two_looks_may_still_be_in_the_shift_register() {
        let mut quiet = Quiet::new();
        assert!(!quiet.look(true, 1000, Baud::B19200));
        quiet.sent();
        assert!(!quiet.look(true, 1003, Baud::B19200));
        assert!(quiet.look(true, 1006, Baud::B19200));
    }
}
