//! A file as a window. It has the right size, and may be anything all the same until a board
//! answers in it: a file of somebody's that was named by mistake gets back what was written to it.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, ErrorKind};

use geni_board::{FileRam, SharedRam};

/// Shared RAM in a file, with what to put back.
pub(super) struct WindowFile {
    ram: FileRam,
    /// Nothing once a board has shown itself: then the window is one.
    written: RefCell<Option<Vec<Written>>>,
}

/// A byte that we have written.
struct Written {
    offset: u16,
    before: u8,
    byte: u8,
}

impl WindowFile {
    /// A file that is a window and nothing else.
    ///
    /// # Errors
    /// As for [`FileRam::new`].
    pub(super) fn new(file: File) -> io::Result<WindowFile> {
        Ok(WindowFile { ram: FileRam::new(file, 0)?, written: RefCell::new(Some(Vec::new())) })
    }

    /// The last error since this was asked.
    pub(super) fn take_error(&self) -> Option<ErrorKind> {
        self.ram.take_error()
    }

    /// Looks whether somebody else has changed what we have written: that is a board.
    fn look(&self, offset: u16, bytes: &[u8]) {
        let mut written = self.written.borrow_mut();
        let is_changed = |ours: &Written| {
            let read = ours.offset.checked_sub(offset).and_then(|at| bytes.get(usize::from(at)));
            read.is_some_and(|&byte| byte != ours.byte)
        };
        if written.as_ref().is_some_and(|written| written.iter().any(is_changed)) {
            *written = None;
        }
    }
}

impl SharedRam for WindowFile {
    fn read(&self, offset: u16) -> u8 {
        let byte = self.ram.read(offset);
        self.look(offset, &[byte]);
        byte
    }

    fn write(&mut self, offset: u16, byte: u8) {
        if let Some(written) = self.written.get_mut() {
            match written.iter_mut().find(|ours| ours.offset == offset) {
                Some(ours) => ours.byte = byte,
                None => written.push(Written { offset, before: self.ram.read(offset), byte }),
            }
        }
        self.ram.write(offset, byte);
    }

    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        self.ram.read_bytes(offset, bytes);
        self.look(offset, bytes);
    }

    fn write_bytes(&mut self, offset: u16, bytes: &[u8]) {
        if self.written.get_mut().is_none() {
            self.ram.write_bytes(offset, bytes);
        } else {
            (offset..).zip(bytes).for_each(|(offset, &byte)| self.write(offset, byte));
        }
    }
}

impl Drop for WindowFile {
    fn drop(&mut self) {
        for Written { offset, before, byte } in self.written.take().into_iter().flatten() {
            if self.ram.read(offset) == byte {
                self.ram.write(offset, before);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::FileExt;

    use geni_board::RAM_LEN;

    use super::*;

    /// A file that is no window, and one that is opened as if it were.
    fn mistaken() -> (tempfile::NamedTempFile, WindowFile) {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), [0xA5; RAM_LEN]).unwrap();
        let window = File::options().read(true).write(true).open(file.path()).unwrap();
        (file, WindowFile::new(window).unwrap())
    }

    #[test]
    fn a_file_without_a_board_is_afterwards_what_it_was() {
        let (file, mut window) = mistaken();
        window.write(7, 0);
        window.write(7, 1);
        window.write_bytes(0x100, &[1, 2, 3]);
        assert_eq!((window.read(7), fs::read(file.path()).unwrap()[7]), (1, 1));
        window.read_bytes(0x0FE, &mut [0; 8]);
        drop(window);
        assert_eq!(fs::read(file.path()).unwrap(), [0xA5; RAM_LEN]);
    }

    #[test]
    fn a_board_that_answers_keeps_what_it_was_told() {
        let (file, mut window) = mistaken();
        window.write(7, 0);
        window.write(8, 3);
        let board = File::options().write(true).open(file.path()).unwrap();
        board.write_all_at(&[1], 7).unwrap();
        let mut bytes = [0; 4];
        window.read_bytes(5, &mut bytes);
        assert_eq!(bytes, [0xA5, 0xA5, 1, 3]);
        window.write(9, 4);
        drop(window);
        assert_eq!(fs::read(file.path()).unwrap()[7..10], [1, 3, 4]);
    }

    #[test]
    fn what_somebody_else_has_written_last_stays() {
        let (file, mut window) = mistaken();
        window.write(7, 0);
        File::options().write(true).open(file.path()).unwrap().write_all_at(&[9], 7).unwrap();
        drop(window);
        assert_eq!(fs::read(file.path()).unwrap()[7], 9);
    }
}
