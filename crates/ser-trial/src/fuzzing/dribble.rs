//! A file that comes slowly.

use std::io::{self, Read};

/// Hands out a few bytes at a time. The bytes themselves say how many.
pub(super) struct Dribble<'a> {
    pub(super) data: &'a [u8],
}

impl Read for Dribble<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let wanted = self.data.first().map_or(0, |&byte| 1 + usize::from(byte) % 5);
        let count = wanted.min(self.data.len()).min(buffer.len());
        let (now, later) = self.data.split_at(count);
        buffer[..count].copy_from_slice(now);
        self.data = later;
        Ok(count)
    }
}
