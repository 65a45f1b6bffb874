//! The RS-232 line between the UART's interrupts and the main loop.
//!
//! A received byte keeps the tick of its arrival, because the moment at which a command arrives
//! matters (it may set the clock), however late the main loop looks. A byte that is lost or misread
//! is counted at once, in a count of its own. The main loop learns of it even if no other byte ever
//! comes and even if the ring is full.

use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, Ordering};

use ser_node::TickStamp;
use ser_proto::Baud;

use crate::counter::Counter;
use crate::ring::{Reader, Ring, Slot, Writer};

/// Bits of a character with start and stop bit.
pub const CHARACTER_BITS: u32 = 10;

/// A byte that has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ReceivedByte {
    /// The byte.
    pub byte: u8,
    /// When.
    pub at: TickStamp,
}

/// Takes the oldest byte out of the ring, if it arrived no later than at tick `now_ms`. A byte that
/// arrived after that tick was read waits for the next look.
pub fn take_until<const N: usize>(
    ring: &mut Reader<'_, ReceivedByte, N>,
    now_ms: u32,
) -> Option<ReceivedByte> {
    let has_come =
        |received: &ReceivedByte| now_ms.wrapping_sub(received.at.tick_ms) <= u32::MAX / 2;
    ring.peek().filter(has_come)?;
    ring.pop()
}

/// One received byte in a ring.
pub struct ReceivedCell {
    tick_ms: AtomicU32,
    us: AtomicU16,
    byte: AtomicU8,
}

impl Slot for ReceivedByte {
    type Cell = ReceivedCell;
    const EMPTY: ReceivedCell =
        ReceivedCell { tick_ms: AtomicU32::new(0), us: AtomicU16::new(0), byte: AtomicU8::new(0) };

    #[inline]
    fn store(self, cell: &ReceivedCell) {
        cell.tick_ms.store(self.at.tick_ms, Ordering::Relaxed);
        cell.us.store(self.at.us, Ordering::Relaxed);
        cell.byte.store(self.byte, Ordering::Relaxed);
    }

    #[inline]
    fn load(cell: &ReceivedCell) -> ReceivedByte {
        ReceivedByte {
            byte: cell.byte.load(Ordering::Relaxed),
            at: TickStamp {
                tick_ms: cell.tick_ms.load(Ordering::Relaxed),
                us: cell.us.load(Ordering::Relaxed),
            },
        }
    }
}

/// Memory of the rings of both directions, for a static. See [`budget`](crate::budget) for the
/// lengths.
pub struct SerialRings<const RECEIVE: usize, const TRANSMIT: usize> {
    receive: Ring<ReceivedByte, RECEIVE>,
    transmit: Ring<u8, TRANSMIT>,
    errors: Counter,
}

/// The ends of [`SerialRings`].
pub struct SerialEnds<'a, const RECEIVE: usize, const TRANSMIT: usize> {
    /// The receive interrupt's end.
    pub receiver: Receiver<'a, RECEIVE>,
    /// The main loop's end of the received bytes.
    pub received: Reader<'a, ReceivedByte, RECEIVE>,
    /// The main loop's end of the count of bytes lost or misread.
    pub errors: LineErrors<'a>,
    /// The main loop's end of the bytes to send.
    pub to_send: Writer<'a, u8, TRANSMIT>,
    /// The transmit interrupt's end.
    pub transmitter: Reader<'a, u8, TRANSMIT>,
}

impl<const RECEIVE: usize, const TRANSMIT: usize> SerialRings<RECEIVE, TRANSMIT> {
    /// Empty rings.
    #[must_use]
    pub const fn new() -> Self {
        SerialRings { receive: Ring::new(), transmit: Ring::new(), errors: Counter::new() }
    }

    /// The ends of both rings.
    pub fn split(&mut self) -> SerialEnds<'_, RECEIVE, TRANSMIT> {
        let (receiver, received) = self.receive.split();
        let (to_send, transmitter) = self.transmit.split();
        let receiver = Receiver { ring: receiver, errors: &self.errors };
        let errors = LineErrors { errors: &self.errors, told: self.errors.get() };
        SerialEnds { receiver, received, errors, to_send, transmitter }
    }
}

impl<const RECEIVE: usize, const TRANSMIT: usize> Default for SerialRings<RECEIVE, TRANSMIT> {
    fn default() -> Self {
        Self::new()
    }
}

/// The status of a UART that holds one received byte, such as those of STM32: SR's RXNE, ORE, and
/// FE or NF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceiveStatus {
    /// The data register holds a byte that has not been taken yet.
    pub has_byte: bool,
    /// A byte was lost because it found the data register full. The data register keeps its byte.
    pub overrun: bool,
    /// The byte in the data register differs from what was sent: its stop bit is missing, or noise
    /// was seen.
    pub misread: bool,
}

/// The receive interrupt's end.
pub struct Receiver<'a, const N: usize> {
    ring: Writer<'a, ReceivedByte, N>,
    errors: &'a Counter,
}

impl<const N: usize> Receiver<'_, N> {
    /// Whether another byte finds room. While there is none, a UART that can keep bytes or hold the
    /// other side back is left alone.
    #[inline]
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.ring.has_room()
    }

    /// Takes a byte from the UART. Without room it is lost.
    #[inline]
    pub fn push(&mut self, received: ReceivedByte) {
        if !self.ring.push(received) {
            self.count_error();
        }
    }

    /// Counts a byte that was lost or misread.
    #[inline]
    pub fn count_error(&mut self) {
        self.errors.count();
    }

    /// Takes what a UART has, as its status shows. `read` reads the data register, which clears
    /// every flag of that status.
    ///
    /// A byte may arrive between the look at the status and the read. The UART then shows an
    /// overrun and no byte the next time, while its data register still holds the byte that was
    /// read. Reading it again only clears the overrun.
    #[inline]
    pub fn take(&mut self, shown: ReceiveStatus, read: impl FnOnce() -> u8, at: TickStamp) {
        let ReceiveStatus { has_byte, overrun, misread } = shown;
        if !has_byte && !overrun {
            return;
        }
        let byte = read();
        if has_byte {
            self.push(ReceivedByte { byte, at });
        }
        for _ in 0..u32::from(has_byte && misread) + u32::from(overrun) {
            self.count_error();
        }
    }
}

/// The main loop's end of the count of bytes that were lost or misread.
pub struct LineErrors<'a> {
    errors: &'a Counter,
    told: u32,
}

impl LineErrors<'_> {
    /// How many bytes were lost or misread since the last call.
    pub fn take(&mut self) -> u32 {
        let errors = self.errors.get();
        let new = errors.wrapping_sub(self.told);
        self.told = errors;
        new
    }
}

/// Tells when everything sent has left the transmitter, for UARTs that only report whether they
/// have room.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet {
    /// Since when the transmitter has been seen idle.
    since_ms: Option<u32>,
}

impl Quiet {
    /// The transmitter has not been looked at yet.
    #[must_use]
    pub const fn new() -> Quiet {
        Quiet { since_ms: None }
    }

    /// Says that a byte has been queued for the transmitter, which may send it before the next
    /// look.
    pub const fn sent(&mut self) {
        self.since_ms = None;
    }

    /// Looks at the transmitter. `idle` says that no byte waits in the ring or in the UART's data
    /// register.
    ///
    /// True two characters' time after the first look that found it idle, because one character may
    /// be in the shift register. The time counts from looks and not from bytes: no character is cut
    /// short, however rare the looks. Bytes sent in between must be reported by
    /// [`sent`](Self::sent).
    pub fn look(&mut self, idle: bool, now_ms: u32, baud: Baud) -> bool {
        if !idle {
            self.since_ms = None;
            return false;
        }
        let since_ms = *self.since_ms.get_or_insert(now_ms);
        now_ms.wrapping_sub(since_ms) > character_ms(baud, 2)
    }
}

/// How long that many characters take, in milliseconds, rounded up.
#[must_use]
pub const fn character_ms(baud: Baud, characters: u32) -> u32 {
    (characters * CHARACTER_BITS * 1000).div_ceil(baud.bits_per_second())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn byte(byte: u8, tick_ms: u32) -> ReceivedByte {
        ReceivedByte { byte, at: tick_ms.into() }
    }

    #[test]
    fn a_byte_keeps_its_tick() {
        let mut rings = SerialRings::<4, 4>::new();
        let mut ends = rings.split();
        let bytes = [byte(0x00, 0), byte(0xFF, u32::MAX), byte(0xA5, 70_000)];
        for received in bytes {
            ends.receiver.push(received);
        }
        assert_eq!(std::iter::from_fn(|| ends.received.pop()).collect::<Vec<_>>(), bytes);
        assert_eq!(ends.errors.take(), 0);
    }

    #[test]
    fn a_byte_that_came_after_the_tick_was_read_waits() {
        let mut rings = SerialRings::<4, 4>::new();
        let mut ends = rings.split();
        for tick_ms in [u32::MAX, 0, 1] {
            ends.receiver.push(byte(b'x', tick_ms));
        }
        let mut take =
            |now_ms| take_until(&mut ends.received, now_ms).map(|received| received.at.tick_ms);
        assert_eq!(
            [take(u32::MAX - 1), take(u32::MAX), take(u32::MAX)],
            [None, Some(u32::MAX), None]
        );
        assert_eq!([take(7), take(7), take(7)], [Some(0), Some(1), None]);
    }

    #[test]
    fn bytes_that_find_no_room_are_counted_at_once_and_once() {
        let mut rings = SerialRings::<2, 2>::new();
        let mut ends = rings.split();
        for tick_ms in 1..=5 {
            ends.receiver.push(byte(b'x', tick_ms));
        }
        assert!(!ends.receiver.has_room());
        assert_eq!((ends.errors.take(), ends.errors.take()), (3, 0));
        assert_eq!(
            (ends.received.pop(), ends.received.pop()),
            (Some(byte(b'x', 1)), Some(byte(b'x', 2)))
        );
        ends.receiver.push(byte(b'y', 6));
        assert_eq!((ends.received.pop(), ends.errors.take()), (Some(byte(b'y', 6)), 0));
        // A new split starts without the errors counted before it.
        ends.receiver.count_error();
        assert_eq!(rings.split().errors.take(), 0);
    }

    /// A UART as the reference manual of the STM32F4 describes it (RM0090, "Overrun error").
    /// Reading the data register takes the byte and clears the flags that the latest look at the
    /// status showed.
    #[derive(Default)]
    struct Uart {
        data: u8,
        rxne: bool,
        ore: bool,
        fe: bool,
        ore_shown: bool,
        reads: u32,
    }

    impl Uart {
        fn arrive(&mut self, byte: u8) {
            if self.rxne {
                self.ore = true;
            } else {
                (self.data, self.rxne) = (byte, true);
            }
        }

        fn status(&mut self) -> ReceiveStatus {
            self.ore_shown = self.ore;
            ReceiveStatus { has_byte: self.rxne, overrun: self.ore, misread: self.fe }
        }

        fn read(&mut self) -> u8 {
            self.reads += 1;
            (self.rxne, self.fe) = (false, false);
            self.ore &= !self.ore_shown;
            self.data
        }
    }

    /// Takes interrupts until there are none; bytes arrive between looking and reading.
    fn interrupts(uart: &mut Uart, receiver: &mut Receiver<'_, 8>, mut between: &[u8]) {
        for _ in 0..10 {
            if !uart.rxne && !uart.ore {
                return;
            }
            let status = uart.status();
            if let [first, rest @ ..] = between {
                uart.arrive(*first);
                between = rest;
            }
            receiver.take(status, || uart.read(), 7.into());
        }
        panic!("the interrupt never ends");
    }

    fn received_by(uart: &mut Uart, between: &[u8]) -> (Vec<u8>, u32) {
        let mut rings = SerialRings::<8, 2>::new();
        let mut ends = rings.split();
        interrupts(uart, &mut ends.receiver, between);
        (
            std::iter::from_fn(|| ends.received.pop()).map(|received| received.byte).collect(),
            ends.errors.take(),
        )
    }

    #[test]
    fn an_overrun_without_a_byte_hands_over_nothing_and_counts_one() {
        let mut uart = Uart::default();
        uart.arrive(b'a');
        // The second byte comes after the look and before the read. The read leaves its overrun
        // without a byte.
        assert_eq!(received_by(&mut uart, b"b"), (b"a".to_vec(), 1));
        assert_eq!(uart.reads, 2, "the second one clears the overrun");
        uart.arrive(b'c');
        assert_eq!(received_by(&mut uart, b""), (b"c".to_vec(), 0));
    }

    #[test]
    fn an_overrun_with_a_byte_hands_it_over_and_counts_the_other_one() {
        let mut uart = Uart::default();
        uart.arrive(b'a');
        uart.arrive(b'b');
        assert_eq!(received_by(&mut uart, b""), (b"a".to_vec(), 1));
        // A third byte between look and read is also lost, under the same flag.
        uart.arrive(b'c');
        uart.arrive(b'd');
        assert_eq!(received_by(&mut uart, b"e"), (b"c".to_vec(), 1));
    }

    #[test]
    fn a_misread_byte_is_handed_over_and_counted() {
        let mut uart = Uart::default();
        uart.arrive(b'a');
        uart.fe = true;
        assert_eq!(received_by(&mut uart, b""), (b"a".to_vec(), 1));
        uart.arrive(b'b');
        uart.arrive(b'c');
        uart.fe = true;
        assert_eq!(received_by(&mut uart, b""), (b"b".to_vec(), 2));
    }

    #[test]
    fn an_interrupt_of_the_transmitter_reads_nothing() {
        let mut uart = Uart { data: b'z', ..Uart::default() };
        let mut rings = SerialRings::<8, 2>::new();
        let mut ends = rings.split();
        ends.receiver.take(uart.status(), || unreachable!("there is nothing to read"), 0.into());
        assert_eq!((ends.received.pop(), ends.errors.take()), (None, 0));
    }

    #[test]
    fn the_line_is_quiet_two_characters_after_it_was_first_seen_idle() {
        let mut quiet = Quiet::new();
        assert!(!quiet.look(false, 0, Baud::B19200));
        assert!(!quiet.look(true, 1000, Baud::B19200));
        // 20 bits at 19200 bit/s take 1.04 ms, and the tick may have been about to end.
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
