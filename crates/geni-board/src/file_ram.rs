//! Shared RAM in a file.

use std::cell::Cell;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use crate::ram::{RAM_LEN, SharedRam};

/// A window of 16 KiB in a file that the other side also has open or mapped into memory.
#[derive(Debug)]
pub struct FileRam {
    file: File,
    base: u64,
    error: Cell<Option<io::ErrorKind>>,
}

impl FileRam {
    /// The window that begins `base` bytes into the file.
    ///
    /// # Errors
    ///
    /// When the file ends before the window does, or when its length cannot be found.
    pub fn new(file: File, base: u64) -> io::Result<FileRam> {
        check_length(&file, base)?;
        Ok(FileRam { file, base, error: Cell::new(None) })
    }

    /// The last error of the file since the previous call. A byte that could not be read was taken
    /// as all ones.
    pub fn take_error(&self) -> Option<io::ErrorKind> {
        self.error.take()
    }

    fn in_window(offset: u16, len: usize) -> bool {
        usize::from(offset) + len <= RAM_LEN
    }

    fn note(&self, error: &io::Error) {
        self.error.set(Some(error.kind()));
    }
}

impl SharedRam for FileRam {
    fn read(&self, offset: u16) -> u8 {
        let mut byte = [0xFF];
        self.read_bytes(offset, &mut byte);
        let [byte] = byte;
        byte
    }

    fn write(&mut self, offset: u16, byte: u8) {
        self.write_bytes(offset, &[byte]);
    }

    // One system call reads a whole run of bytes.
    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        if !Self::in_window(offset, bytes.len()) {
            bytes.fill(0xFF);
        } else if let Err(error) = self.file.read_exact_at(bytes, self.base + u64::from(offset)) {
            bytes.fill(0xFF);
            self.note(&error);
        }
    }

    fn write_bytes(&mut self, offset: u16, bytes: &[u8]) {
        if Self::in_window(offset, bytes.len())
            && let Err(error) = self.file.write_all_at(bytes, self.base + u64::from(offset))
        {
            self.note(&error);
        }
    }
}

/// Checks that a window fits the file from `base` on.
pub(crate) fn check_length(file: &File, base: u64) -> io::Result<()> {
    match base.checked_add(RAM_LEN as u64) {
        Some(end) if end <= file.metadata()?.len() => Ok(()),
        _ => Err(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            "the file ends before the window does",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(len: u64) -> File {
        let file = tempfile::tempfile().expect("a temporary file");
        file.set_len(len).expect("room");
        file
    }

    #[test]
    fn two_windows_of_one_file_see_the_same_bytes() {
        let file = file(0x4100);
        let other = file.try_clone().expect("a second handle");
        let mut host = FileRam::new(file, 0x100).expect("a window");
        let board = FileRam::new(other, 0x100).expect("a window");
        host.write(0x08C2, 1);
        host.write_bytes(0x08D2, &[1, 2, 3]);
        let mut bytes = [0; 3];
        board.read_bytes(0x08D2, &mut bytes);
        assert_eq!((board.read(0x08C2), bytes), (1, [1, 2, 3]));
        host.write(0x3FFF, 9);
        host.write(0x4000, 9);
        assert_eq!((board.read(0x3FFF), board.read(0x4000)), (9, 0xFF));
        assert_eq!(board.take_error(), None);
    }

    #[test]
    fn a_file_that_got_shorter_reads_as_ones() {
        let file = file(0x4000);
        let other = file.try_clone().expect("a second handle");
        let ram = FileRam::new(file, 0).expect("a window");
        other.set_len(0).expect("truncated");
        assert_eq!(ram.read(0), 0xFF);
        assert_eq!(ram.take_error(), Some(io::ErrorKind::UnexpectedEof));
        assert_eq!(ram.take_error(), None);
    }

    #[test]
    fn a_file_that_is_too_short_is_no_window_and_stays_as_it_is() {
        for (len, base) in [(0, 0), (0x3FFF, 0), (0x4000, 1), (0x4000, u64::MAX)] {
            let file = file(len);
            let other = file.try_clone().expect("a second handle");
            let error = FileRam::new(file, base).expect_err("too short");
            assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof, "{len} {base}");
            assert_eq!(other.metadata().expect("a file").len(), len);
        }
    }
}
