//! The board's own access to the shared RAM.

use crate::genius::map::RAM_LEN;

pub(super) struct Ram {
    bytes: Box<[u8; RAM_LEN]>,
}

impl Ram {
    pub(super) fn new() -> Ram {
        Ram { bytes: Box::new([0; RAM_LEN]) }
    }

    pub(super) fn bytes(&self) -> &[u8; RAM_LEN] {
        &self.bytes
    }

    pub(super) fn fill(&mut self, byte: u8) {
        self.bytes.fill(byte);
    }

    pub(super) fn get(&self, at: usize) -> u8 {
        self.bytes[at]
    }

    pub(super) fn set(&mut self, at: usize, byte: u8) {
        self.bytes[at] = byte;
    }

    pub(super) fn bit0(&self, at: usize) -> bool {
        self.bytes[at] & 1 != 0
    }

    pub(super) fn set_word(&mut self, at: usize, word: u16) {
        self.write(at, &word.to_le_bytes());
    }

    pub(super) fn word(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]])
    }

    pub(super) fn read(&self, at: usize, len: usize) -> &[u8] {
        &self.bytes[at..at + len]
    }

    pub(super) fn write(&mut self, at: usize, data: &[u8]) {
        self.bytes[at..at + data.len()].copy_from_slice(data);
    }
}
