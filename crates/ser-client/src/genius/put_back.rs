//! A window that may not be one. A user may give the wrong file or the wrong place in it. So the
//! original bytes are remembered and restored unless a board answers.

use std::cell::RefCell;

use geni_board::SharedRam;

/// Shared RAM, with the bytes to restore.
pub(super) struct PutBack<R: SharedRam> {
    ram: R,
    /// `None` once a board has answered, which proves that the file is a window.
    written: RefCell<Option<Vec<Written>>>,
}

/// A byte that this host has written.
struct Written {
    offset: u16,
    before: u8,
    byte: u8,
}

impl<R: SharedRam> PutBack<R> {
    pub(super) const fn new(ram: R) -> PutBack<R> {
        PutBack { ram, written: RefCell::new(Some(Vec::new())) }
    }

    /// The window itself.
    pub(super) const fn ram(&self) -> &R {
        &self.ram
    }

    /// Checks whether another program has changed a written byte: that is a board.
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

impl<R: SharedRam> SharedRam for PutBack<R> {
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

impl<R: SharedRam> Drop for PutBack<R> {
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
    use std::fs::{self, File};
    use std::os::unix::fs::FileExt;

    use geni_board::{FileRam, RAM_LEN};

    use super::*;

    /// A file that is not a window, opened as if it were one.
    fn mistaken() -> (tempfile::NamedTempFile, PutBack<FileRam>) {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), [0xA5; RAM_LEN]).unwrap();
        let window = File::options().read(true).write(true).open(file.path()).unwrap();
        (file, PutBack::new(FileRam::new(window, 0).unwrap()))
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
