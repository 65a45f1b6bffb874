//! Shared RAM that is memory behind a file: a device, or a board's address range on a computer's
//! bus.
#![expect(unsafe_code, reason = "a window in memory can only be reached through a pointer")]

use std::fs::File;
use std::io;
use std::ptr::NonNull;

use memmap2::{MmapOptions, MmapRaw};

use crate::file_ram::check_length;
use crate::ram::{RAM_LEN, SharedRam};
use crate::window_ram::WindowRam;

/// A window of 16 KiB that is mapped into this process and accessed byte by byte.
///
/// It reaches a board inside the computer, whose RAM cannot be read and written like a file. A
/// regular file must keep its length while it is mapped: an access beyond its end ends the process.
#[derive(Debug)]
pub struct MappedRam {
    window: WindowRam,
    // Keeps the mapping alive, on which the window depends.
    _map: MmapRaw,
}

impl MappedRam {
    /// Maps the window that begins `base` bytes into `file`.
    ///
    /// # Errors
    ///
    /// When the file cannot be mapped, or is a regular file that ends before the window does.
    pub fn new(file: &File, base: u64) -> io::Result<MappedRam> {
        if file.metadata()?.is_file() {
            check_length(file, base)?;
        }
        let map = MmapOptions::new().offset(base).len(RAM_LEN).map_raw(file)?;
        let base = NonNull::new(map.as_mut_ptr()).ok_or(io::ErrorKind::AddrNotAvailable)?;
        // SAFETY: the mapping is `RAM_LEN` bytes long, may be read and written, and lives as long
        // as the window, which is the only one to use it. What lies behind it may change at any
        // time and is used by the byte.
        let window = unsafe { WindowRam::new(base) };
        Ok(MappedRam { window, _map: map })
    }
}

impl SharedRam for MappedRam {
    fn read(&self, offset: u16) -> u8 {
        self.window.read(offset)
    }

    fn write(&mut self, offset: u16, byte: u8) {
        self.window.write(offset, byte);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FileRam;

    /// The window begins within a page of memory, as a board's may.
    const BASE: u64 = 0x1100;

    #[test]
    fn a_mapped_window_and_one_that_is_read_as_a_file_see_the_same_bytes() {
        let file = tempfile::tempfile().expect("a temporary file");
        file.set_len(BASE + RAM_LEN as u64).expect("room");
        let mut host = MappedRam::new(&file, BASE).expect("a window");
        let mut board = FileRam::new(file, BASE).expect("a window");
        host.write(0x08C2, 1);
        host.write_bytes(0x3FFD, &[1, 2, 3, 4]);
        let mut bytes = [0; 3];
        board.read_bytes(0x3FFD, &mut bytes);
        assert_eq!((board.read(0x08C2), bytes), (1, [1, 2, 3]));
        board.write_word(0x0893, 0x1234);
        assert_eq!((host.read_word(0x0893), host.read(0x4000)), (0x1234, 0xFF));
    }

    #[test]
    fn a_file_that_ends_too_early_is_no_window_and_stays_as_it_is() {
        let file = tempfile::tempfile().expect("a temporary file");
        file.set_len(RAM_LEN as u64).expect("room");
        for base in [1, u64::MAX] {
            let error = MappedRam::new(&file, base).expect_err("too short");
            assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof, "{base}");
        }
        assert_eq!(file.metadata().expect("a file").len(), RAM_LEN as u64);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_are_mapped_if_they_can_be() {
        let device = |path| File::options().read(true).write(true).open(path).expect("a device");
        let mut zeros = MappedRam::new(&device("/dev/zero"), 0).expect("memory");
        zeros.write(0x08C2, 1);
        assert_eq!((zeros.read(0x08C2), zeros.read(0x08C3)), (1, 0));
        assert!(MappedRam::new(&device("/dev/null"), 0).is_err());
        assert!(MappedRam::new(&device("/dev/zero"), u64::MAX).is_err());
    }
}
