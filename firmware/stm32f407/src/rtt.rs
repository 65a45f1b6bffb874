//! A ring in memory that a debug probe reads while the processor runs: SEGGER's RTT, one channel
//! up.
//!
//! The probe finds the control block by its symbol, or by its mark in memory. It moves the read
//! position, and the program moves the write position. What does not fit is dropped.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use ser_board::budget::PROBE_RING_LEN as LEN;

#[repr(C)]
struct ControlBlock {
    mark: [u8; 16],
    up_channels: u32,
    down_channels: u32,
    up: Channel,
}

#[repr(C)]
struct Channel {
    name: &'static [u8; 6],
    buffer: &'static [AtomicU8; LEN],
    len: u32,
    write: AtomicU32,
    read: AtomicU32,
    /// The probe's wish for a full ring. New bytes are dropped in any case.
    mode: AtomicU32,
}

static BUFFER: [AtomicU8; LEN] = [const { AtomicU8::new(0) }; LEN];

#[unsafe(no_mangle)]
static _SEGGER_RTT: ControlBlock = ControlBlock {
    mark: *b"SEGGER RTT\0\0\0\0\0\0",
    up_channels: 1,
    down_channels: 0,
    up: Channel {
        name: b"defmt\0",
        buffer: &BUFFER,
        #[expect(clippy::cast_possible_truncation, reason = "1024")]
        len: LEN as u32,
        write: AtomicU32::new(0),
        read: AtomicU32::new(0),
        mode: AtomicU32::new(0),
    },
};

/// Puts bytes into the ring, as far as there is room. One writer at a time; see `log`.
pub(crate) fn write(bytes: &[u8]) {
    let Channel { buffer, write, read, .. } = &_SEGGER_RTT.up;
    let mut position = write.load(Ordering::Relaxed) as usize % LEN;
    for &byte in bytes {
        let next = (position + 1) % LEN;
        // A full ring keeps one cell free, or it would look empty.
        if next == read.load(Ordering::Relaxed) as usize % LEN {
            break;
        }
        if let Some(cell) = buffer.get(position) {
            cell.store(byte, Ordering::Relaxed);
        }
        position = next;
    }
    // Release: a probe that sees the position sees the bytes.
    #[expect(clippy::cast_possible_truncation, reason = "less than 1024")]
    write.store(position as u32, Ordering::Release);
}
