//! Ring lengths, interrupt priorities and the limit of the capture interrupt, each with its
//! derivation. Both boards take all of theirs from here.
//!
//! The rule for lengths: everything that comes in while the main loop is away for
//! [`MAIN_LOOP_STALL_MS`] must find room. The rule for priorities: the less an interrupt can wait,
//! the higher its priority. A build that breaks a rule does not compile.
//!
//! | interrupt                      | can wait for                                  | priority                  |
//! |--------------------------------|-----------------------------------------------|---------------------------|
//! | capture                        | its own millisecond, of which it is the stamp | [`CAPTURE_PRIORITY`]      |
//! | received byte                  | 520 µs                                        | [`RECEIVE_PRIORITY`]      |
//! | transmitter has room           | as long as it likes: a pause on the line      | [`TRANSMIT_PRIORITY`]     |
//! | line of the GENI board         | a millisecond: its tick is that of an arrival | [`EXTERNAL_BUS_PRIORITY`] |
//!
//! The main loop has priority 0. A UART with one interrupt for both directions has it at the
//! receiver's priority.

use ser_node::capture::QUEUE_LEN;
use ser_proto::Baud;

use crate::serial_line::CHARACTER_BITS;

/// The longest time that the main loop may be away from the rings without a loss, in milliseconds.
///
/// In normal operation it is away for far less: a log record of 2 ms, a frame's worth of entries,
/// the programming of one stored record (64 words of at most 100 µs each, `STM32F40x` data sheet,
/// "Flash memory programming"). The rest is reserve for interrupts and for future work.
/// Erasing a flash sector is *not* covered: 16 KiB take up to half a second. An erase is due once
/// in 63 records of a copy (see [`flash_log`](crate::flash_log)), and what it costs is counted.
pub const MAIN_LOOP_STALL_MS: u32 = 100;

/// Changes that capture can produce in a millisecond. It samples once per millisecond, and all
/// inputs that changed in a sample share one entry of the queue. The rate of 1000 per second may
/// last for ever.
pub const CHANGES_PER_MS: u32 = 1;

/// Bits per second at the highest rate of the RS-232 line.
pub const MAX_BITS_PER_SECOND: u32 = Baud::B19200.bits_per_second();

/// Bytes that arrive in that many milliseconds at most: 1.92 each, rounded up.
#[must_use]
pub const fn bytes_in(ms: u32) -> usize {
    (ms * MAX_BITS_PER_SECOND).div_ceil(CHARACTER_BITS * 1000) as usize
}

/// Received bytes that may wait. 192 arrive during a stall; the next power of two holds 133 ms.
pub const RECEIVE_RING_LEN: usize = ring_len(bytes_in(MAIN_LOOP_STALL_MS));

/// How far ahead of the line the main loop may send, in milliseconds.
///
/// A stall makes the line pause, which loses nothing, so it need not be covered. A short ring also
/// leaves little in flight when the rate changes or a reset comes.
pub const TRANSMIT_AHEAD_MS: u32 = 66;

/// Bytes that may wait for the transmitter.
pub const TRANSMIT_RING_LEN: usize = ring_len(bytes_in(TRANSMIT_AHEAD_MS));

/// Instructions that one run of the capture interrupt may take, whatever the inputs do. `cargo
/// xtask timing` counts them, and a test in the emulator checks every case against this limit.
///
/// The interrupt runs a thousand times a second, and a millisecond has 84,000 cycles at 84 MHz, the
/// clock of the board to flash. At 4 cycles each, a high assumption and not a measurement, 150
/// instructions are 600 cycles. That is 0.7 % of the processor, and 7 µs for which everything else
/// waits; the receiver can wait 520 µs. More would work, too. The limit is as close as the longest
/// run allows (debounce of all inputs and a full queue), so that an addition has to be worth it.
/// Everything that can wait belongs in the main loop.
pub const CAPTURE_INSTRUCTIONS: u64 = 150;

/// Priority of the capture interrupt: the highest, because the millisecond of a sample is the
/// product.
pub const CAPTURE_PRIORITY: u8 = 3;

/// Priority of the receive interrupt. It has one character's time, 520 µs at the highest rate,
/// before a byte is lost.
pub const RECEIVE_PRIORITY: u8 = 2;

/// Priority of the transmit interrupt. Being late only makes a pause on the line.
pub const TRANSMIT_PRIORITY: u8 = 1;

/// Priority of the GENI board's interrupt line. The line's edge is latched, so the interrupt may
/// wait. It only takes the tick at which a datagram arrived. The interrupts above it need some 10
/// µs of a millisecond.
pub const EXTERNAL_BUS_PRIORITY: u8 = 1;

/// Pulses of the GENI board's interrupt line that may wait for the main loop. Each means a
/// datagram. The board holds 15 datagrams, and one more may be on its way out.
pub const PULSE_RING_LEN: usize = ring_len(16);

/// Bytes of the log that may wait for a debug probe: everything that a start logs, some 40 records
/// of 25 bytes at most. Records that find no room are dropped; nothing waits for the log.
pub const PROBE_RING_LEN: usize = ring_len(40 * 25);

/// The length of a ring for that many items.
const fn ring_len(items: usize) -> usize {
    items.next_power_of_two()
}

const _: () = assert!(QUEUE_LEN >= (MAIN_LOOP_STALL_MS * CHANGES_PER_MS) as usize);
const _: () = assert!(RECEIVE_RING_LEN >= bytes_in(MAIN_LOOP_STALL_MS));
const _: () = assert!(CAPTURE_PRIORITY > RECEIVE_PRIORITY && RECEIVE_PRIORITY > TRANSMIT_PRIORITY);
const _: () = assert!(RECEIVE_PRIORITY > EXTERNAL_BUS_PRIORITY);
// Priority 0 is the main loop's.
const _: () = assert!(TRANSMIT_PRIORITY > 0 && EXTERNAL_BUS_PRIORITY > 0);
// No chip in use has fewer than eight priorities; one of them is the main loop's.
const _: () = assert!(CAPTURE_PRIORITY < 8);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_in_the_text_are_the_ones_that_come_out() {
        assert_eq!(bytes_in(MAIN_LOOP_STALL_MS), 192);
        assert_eq!((RECEIVE_RING_LEN, bytes_in(133)), (256, 256));
        assert_eq!((TRANSMIT_RING_LEN, bytes_in(TRANSMIT_AHEAD_MS)), (128, 127));
        assert_eq!((PROBE_RING_LEN, PULSE_RING_LEN), (1024, 16));
        assert_eq!(CHARACTER_BITS * 1_000_000 / MAX_BITS_PER_SECOND, 520);
        let capture_cycles = CAPTURE_INSTRUCTIONS * 4;
        assert_eq!(
            (capture_cycles, capture_cycles * 1000 / 84_000, capture_cycles / 84),
            (600, 7, 7)
        );
    }
}
