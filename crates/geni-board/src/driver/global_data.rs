//! The global data that this host sends in every bus scan (chapter 11).

use crate::map;
use crate::ram::SharedRam;

/// The data, and whether the board has them.
#[derive(Debug)]
pub(super) struct GlobalData {
    bytes: [u8; map::MAX_TABLE_LEN as usize],
    len: usize,
    due: bool,
}

impl GlobalData {
    pub(super) const fn new() -> GlobalData {
        GlobalData { bytes: [0; map::MAX_TABLE_LEN as usize], len: 0, due: false }
    }

    /// Sets new data, at most 128 bytes. Unchanged data are not written again.
    pub(super) fn set(&mut self, data: &[u8]) {
        if self.bytes.get(..self.len) == Some(data) {
            return;
        }
        self.len = data.len().min(self.bytes.len());
        for (byte, &new) in self.bytes.iter_mut().zip(data) {
            *byte = new;
        }
        self.due = true;
    }

    /// Has the data written again, because the board may have lost them.
    pub(super) fn due(&mut self) {
        self.due = true;
    }

    pub(super) fn is_due(&self) -> bool {
        self.due && self.len > 0
    }

    /// Writes the data if they are due, but no more than the board sends.
    pub(super) fn write<R: SharedRam>(&mut self, ram: &mut R, broadcast_len: u8) {
        if !self.is_due() {
            return;
        }
        self.due = false;
        let len = self.len.min(broadcast_len.into());
        if let Some(bytes) = self.bytes.get(..len) {
            ram.write_bytes(map::BROADCAST_OUTPUT.start, bytes);
        }
    }
}
