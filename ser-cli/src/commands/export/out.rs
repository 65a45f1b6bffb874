//! A file that is written until the user interrupts it.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// How much is written at a time.
pub(super) const BUFFER: usize = 1 << 18;

/// What an interrupted write fails with. `Interrupted` would be tried again.
const INTERRUPTED: io::ErrorKind = io::ErrorKind::TimedOut;

/// A file that takes nothing any more once the flag is set.
pub(super) struct Out<'f> {
    out: BufWriter<UntilInterrupted<'f>>,
}

impl<'f> Out<'f> {
    pub(super) fn new(file: File, stop: &'f AtomicBool) -> Out<'f> {
        Out { out: BufWriter::with_capacity(BUFFER, UntilInterrupted { file, stop }) }
    }
}

impl Write for Out<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

struct UntilInterrupted<'f> {
    file: File,
    stop: &'f AtomicBool,
}

impl Write for UntilInterrupted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(INTERRUPTED.into()),
            false => self.file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_written_after_an_interrupt() {
        let stop = AtomicBool::new(false);
        let mut out = Out::new(tempfile::tempfile().unwrap(), &stop);
        out.write_all(&[0; 2 * BUFFER]).unwrap();
        stop.store(true, Ordering::Relaxed);
        let stopped = out.write_all(&[0; 2 * BUFFER]).unwrap_err();
        assert_eq!(stopped.kind(), INTERRUPTED);
    }
}
