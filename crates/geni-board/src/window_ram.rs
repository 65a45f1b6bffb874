//! Shared RAM in the address space of a processor.
#![expect(unsafe_code, reason = "a window in memory can only be reached through a pointer")]

use core::ptr::NonNull;

use crate::ram::{RAM_LEN, SharedRam};

/// A window of 16 KiB, one byte per address, that the hardware maps to the shared RAM.
#[derive(Debug)]
pub struct WindowRam {
    base: NonNull<u8>,
}

impl WindowRam {
    /// The window that begins at `base`.
    ///
    /// # Safety
    ///
    /// As long as the value lives, the 16384 bytes from `base` on must be valid for volatile reads
    /// and writes of single bytes, and nothing in this program may reach them in any other way. The
    /// board on the other side may change them at any time.
    #[must_use]
    pub const unsafe fn new(base: NonNull<u8>) -> WindowRam {
        WindowRam { base }
    }

    fn cell(&self, offset: u16) -> Option<*mut u8> {
        let offset = usize::from(offset);
        (offset < RAM_LEN).then(|| self.base.as_ptr().wrapping_add(offset))
    }
}

// SAFETY: the window belongs to this value alone (contract of `new`), and memory does not care
// which context reaches it.
unsafe impl Send for WindowRam {}

impl SharedRam for WindowRam {
    fn read(&self, offset: u16) -> u8 {
        // SAFETY: `cell` gives addresses inside the window only, which is valid for reads by the
        // contract of `new`.
        self.cell(offset).map_or(0xFF, |cell| unsafe { cell.read_volatile() })
    }

    fn write(&mut self, offset: u16, byte: u8) {
        if let Some(cell) = self.cell(offset) {
            // SAFETY: `cell` gives addresses inside the window only, which is valid for writes by
            // the contract of `new`.
            unsafe { cell.write_volatile(byte) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reaches_its_window_and_nothing_beyond() {
        let mut memory = vec![0_u8; RAM_LEN];
        let base = NonNull::new(memory.as_mut_ptr()).expect("a vector is somewhere");
        // SAFETY: the vector has 16 KiB, outlives the window and is not used as long as the window
        // is.
        let mut window = unsafe { WindowRam::new(base) };
        window.write(0, 1);
        window.write(0x3FFF, 2);
        window.write(0x4000, 3);
        assert_eq!((window.read(0), window.read(0x3FFF), window.read(0x4000)), (1, 2, 0xFF));
        assert_eq!((memory[0], memory[0x3FFF]), (1, 2));
    }
}
