//! The log: defmt frames on UART 1.
//!
//! # Design
//! Bytes are written by polling, and no critical section guards the log: see
//! `ser_board::log_writer`.
//!
//! # Tradeoffs
//! Polling holds up the main loop for the length of a record (2 ms at most), so events are not
//! logged. Only `init` and the main loop log. What a fault reports is logged by the start that
//! follows.
//!
//! # Notes
//! `ser-cli sim` writes the frames to a file. `cargo xtask log` turns them into text with the help
//! of the ELF file.

use crate::device::{self, base};
use crate::mmio::Word;
use crate::timer;
use ser_board::log_writer::LogWriter;

const BITS_PER_SECOND: u32 = 115_200;

const TRANSMIT_FULL: u32 = 1 << 0;
const TRANSMIT_ENABLE: u32 = 1 << 0;

/// Looks at a full transmitter before a byte is given up: some four characters' time.
const MAX_LOOKS: u32 = 1000;

// SAFETY: AN385 has the UART's registers at these addresses.
const DATA: Word = unsafe { Word::at(base::UART1) };
// SAFETY: as above.
const STATE: Word = unsafe { Word::at(base::UART1 + 0x4) };
// SAFETY: as above.
const CONTROL: Word = unsafe { Word::at(base::UART1 + 0x8) };
// SAFETY: as above.
const BAUD_DIVIDER: Word = unsafe { Word::at(base::UART1 + 0x10) };

/// Starts the UART. Without this, log records go nowhere.
pub(crate) fn start() {
    BAUD_DIVIDER.write(device::CLOCK_HZ / BITS_PER_SECOND);
    CONTROL.write(TRANSMIT_ENABLE);
}

defmt::timestamp!("{=u32:ms}", timer::tick_ms());

#[defmt::global_logger]
struct Logger;

static LOG: LogWriter<defmt::Encoder> = LogWriter::new(defmt::Encoder::new());

// SAFETY: `acquire` and `release` may be called from anywhere: see `LogWriter`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        LOG.acquire(write_bytes);
    }

    unsafe fn flush() {
        wait_for_room();
    }

    unsafe fn release() {
        LOG.release(write_bytes);
    }

    unsafe fn write(bytes: &[u8]) {
        LOG.write(bytes, write_bytes);
    }
}

fn write_bytes(bytes: &[u8]) {
    for &byte in bytes {
        if wait_for_room() {
            DATA.write(u32::from(byte));
        }
    }
}

fn wait_for_room() -> bool {
    (0..MAX_LOOKS).any(|_| STATE.read() & TRANSMIT_FULL == 0)
}
