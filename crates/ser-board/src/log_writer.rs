//! Frames of the log, one writer at a time, without a critical section.
//!
//! # Design
//! Logging never delays the capture interrupt, so nothing guards a record while it is written. A
//! context that interrupts the writer writes nothing. This is safe because contexts nest: an
//! interrupting context has released the log before the interrupted one goes on.

use core::sync::atomic::{AtomicU32, Ordering};

use atomic_refcell::AtomicRefCell;

/// Makes frames of records.
pub trait FrameEncoder {
    /// Begins a frame.
    fn start_frame(&mut self, write: impl FnMut(&[u8]));

    /// Adds a part of the record.
    fn write(&mut self, bytes: &[u8], write: impl FnMut(&[u8]));

    /// Ends the frame.
    fn end_frame(&mut self, write: impl FnMut(&[u8]));
}

#[cfg(feature = "defmt")]
impl FrameEncoder for defmt::Encoder {
    fn start_frame(&mut self, write: impl FnMut(&[u8])) {
        defmt::Encoder::start_frame(self, write);
    }

    fn write(&mut self, bytes: &[u8], write: impl FnMut(&[u8])) {
        defmt::Encoder::write(self, bytes, write);
    }

    fn end_frame(&mut self, write: impl FnMut(&[u8])) {
        defmt::Encoder::end_frame(self, write);
    }
}

/// Writes the records of the outermost context; for a static. `write` puts bytes where the log
/// goes.
pub struct LogWriter<E> {
    /// Records being written, one nested in the other.
    depth: AtomicU32,
    encoder: AtomicRefCell<E>,
}

impl<E: FrameEncoder> LogWriter<E> {
    /// No record is being written.
    pub const fn new(encoder: E) -> LogWriter<E> {
        LogWriter { depth: AtomicU32::new(0), encoder: AtomicRefCell::new(encoder) }
    }

    /// Begins a record.
    pub fn acquire(&self, write: impl FnMut(&[u8])) {
        self.depth.fetch_add(1, Ordering::Relaxed);
        self.outermost(|encoder| encoder.start_frame(write));
    }

    /// Writes a part of the record that began last.
    pub fn write(&self, bytes: &[u8], write: impl FnMut(&[u8])) {
        self.outermost(|encoder| encoder.write(bytes, write));
    }

    /// Completes the record that began last.
    pub fn release(&self, write: impl FnMut(&[u8])) {
        self.outermost(|encoder| encoder.end_frame(write));
        self.depth.fetch_sub(1, Ordering::Relaxed);
    }

    fn outermost(&self, step: impl FnOnce(&mut E)) {
        // Always present, because the encoder is lent to the outermost record only.
        if self.depth.load(Ordering::Relaxed) == 1
            && let Ok(mut encoder) = self.encoder.try_borrow_mut()
        {
            step(&mut encoder);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// Frames in brackets.
    struct Brackets;

    impl FrameEncoder for Brackets {
        fn start_frame(&mut self, mut write: impl FnMut(&[u8])) {
            write(b"[");
        }

        fn write(&mut self, bytes: &[u8], mut write: impl FnMut(&[u8])) {
            write(bytes);
        }

        fn end_frame(&mut self, mut write: impl FnMut(&[u8])) {
            write(b"]");
        }
    }

    fn record(log: &LogWriter<Brackets>, text: &str, mut write: impl FnMut(&[u8])) {
        log.acquire(&mut write);
        log.write(text.as_bytes(), &mut write);
        log.release(&mut write);
    }

    #[test]
    fn records_are_frames_one_after_the_other() {
        let (log, mut written) = (LogWriter::new(Brackets), Vec::new());
        record(&log, "one", |bytes| written.extend_from_slice(bytes));
        record(&log, "two", |bytes| written.extend_from_slice(bytes));
        assert_eq!(written, b"[one][two]");
    }

    #[test]
    fn whoever_interrupts_a_record_writes_nothing_and_spoils_nothing() {
        // At every point where a byte leaves, and between the parts.
        let (log, written) = (LogWriter::new(Brackets), RefCell::new(Vec::new()));
        let plain = |bytes: &[u8]| written.borrow_mut().extend_from_slice(bytes);
        let interrupted = |bytes: &[u8]| {
            record(&log, "inner", plain);
            plain(bytes);
        };
        log.acquire(interrupted);
        record(&log, "inner", plain);
        log.write(b"outer", interrupted);
        // Two levels of interruption.
        log.acquire(plain);
        record(&log, "innermost", plain);
        log.release(plain);
        log.release(interrupted);
        record(&log, "next", plain);
        assert_eq!(*written.borrow(), b"[outer][next]");
    }
}
