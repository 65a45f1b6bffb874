//! Access to the shared RAM.

use core::iter;

/// Bytes of shared RAM.
pub const RAM_LEN: usize = 0x4000;

/// The 16 KiB that host and board share, byte by byte.
///
/// Offsets are those of [`map`](crate::map). Offsets beyond the window read as all ones and ignore
/// writes. Accesses return no errors: a RAM that cannot be reached also reads as all ones, and the
/// missing heartbeat shows it.
///
/// Both sides may change any byte at any time, so every call must access the RAM, in program order.
pub trait SharedRam {
    /// The byte at an offset.
    fn read(&self, offset: u16) -> u8;

    /// Changes the byte at an offset.
    fn write(&mut self, offset: u16, byte: u8);

    /// Fills `bytes` from ascending offsets.
    fn read_bytes(&self, offset: u16, bytes: &mut [u8]) {
        for (byte, offset) in bytes.iter_mut().zip(from(offset)) {
            *byte = self.read(offset);
        }
    }

    /// Writes `bytes` to ascending offsets.
    fn write_bytes(&mut self, offset: u16, bytes: &[u8]) {
        for (&byte, offset) in bytes.iter().zip(from(offset)) {
            self.write(offset, byte);
        }
    }

    /// A word, low byte first.
    ///
    /// The board may change it between the two reads. When the high byte has changed meanwhile, the
    /// low byte is read again. No word on the board changes faster than that.
    fn read_word(&self, offset: u16) -> u16 {
        let high_offset = offset.saturating_add(1);
        let high_before = self.read(high_offset);
        let low = self.read(offset);
        let high = self.read(high_offset);
        let low = if high == high_before { low } else { self.read(offset) };
        u16::from_le_bytes([low, high])
    }

    /// Writes a word, low byte first.
    fn write_word(&mut self, offset: u16, word: u16) {
        self.write_bytes(offset, &word.to_le_bytes());
    }
}

/// Ascending offsets from `offset`, without end. The highest one repeats; it stands for all offsets
/// beyond it.
fn from(offset: u16) -> impl Iterator<Item = u16> {
    (offset..=u16::MAX).chain(iter::repeat(u16::MAX))
}

impl<R: SharedRam> SharedRam for &mut R {
    fn read(&self, offset: u16) -> u8 {
        R::read(self, offset)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        R::write(self, offset, byte);
    }
}

/// A RAM that is not shared: an array, for tests.
#[derive(Clone, Debug)]
pub struct ArrayRam([u8; RAM_LEN]);

impl ArrayRam {
    /// A RAM whose bytes are all zero.
    #[must_use]
    pub const fn new() -> ArrayRam {
        ArrayRam([0; RAM_LEN])
    }
}

impl Default for ArrayRam {
    fn default() -> ArrayRam {
        ArrayRam::new()
    }
}

impl SharedRam for ArrayRam {
    fn read(&self, offset: u16) -> u8 {
        self.0.get(usize::from(offset)).copied().unwrap_or(0xFF)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        if let Some(cell) = self.0.get_mut(usize::from(offset)) {
            *cell = byte;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_little_endian() {
        let mut ram = ArrayRam::new();
        ram.write_word(0x0883, 0x1234);
        assert_eq!((ram.read(0x0883), ram.read(0x0884)), (0x34, 0x12));
        assert_eq!(ram.read_word(0x0883), 0x1234);
    }

    #[test]
    fn there_is_nothing_beyond_the_end() {
        let mut ram = ArrayRam::new();
        ram.write(0x4000, 1);
        ram.write_bytes(0x3FFF, &[2, 3]);
        let mut bytes = [0; 2];
        ram.read_bytes(0x3FFF, &mut bytes);
        assert_eq!(bytes, [2, 0xFF]);
        assert_eq!(ram.read_word(u16::MAX), 0xFFFF);
        ram.write_bytes(0xFFFE, &[4; 4]);
        let mut bytes = [0; 4];
        ram.read_bytes(0xFFFE, &mut bytes);
        assert_eq!(bytes, [0xFF; 4]);
    }

    /// A word that the board counts up from 00FFh to 0100h after its first byte has been read.
    struct Counting(core::cell::Cell<u8>);

    impl SharedRam for Counting {
        fn read(&self, offset: u16) -> u8 {
            let reads = self.0.get();
            self.0.set(reads + 1);
            let word: u16 = if reads == 0 { 0x00FF } else { 0x0100 };
            word.to_le_bytes()[usize::from(offset)]
        }

        fn write(&mut self, _offset: u16, _byte: u8) {}
    }

    #[test]
    fn a_word_that_changes_while_it_is_read_is_not_torn() {
        assert_eq!(Counting(core::cell::Cell::new(0)).read_word(0), 0x0100);
    }
}
