//! Memory-mapped words.

use core::ptr;

/// A 32-bit word that hardware, or another processor, also reads and writes.
#[derive(Clone, Copy)]
pub(crate) struct Word {
    address: usize,
}

impl Word {
    /// The word at `address`.
    ///
    /// # Safety
    /// `address` is a multiple of four, lies outside of the memory that the linker hands out, and
    /// the board has something there that can be read and written at any time without upsetting
    /// memory safety.
    pub(crate) const unsafe fn at(address: usize) -> Word {
        Word { address }
    }

    pub(crate) fn read(self) -> u32 {
        // SAFETY: promised by whoever called `at`.
        unsafe { ptr::read_volatile(ptr::with_exposed_provenance(self.address)) }
    }

    pub(crate) fn write(self, value: u32) {
        // SAFETY: promised by whoever called `at`.
        unsafe { ptr::write_volatile(ptr::with_exposed_provenance_mut(self.address), value) }
    }
}
