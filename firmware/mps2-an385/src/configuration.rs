//! The configuration's memory: a simulated flash of two small sectors on the external bus.
//!
//! # Design
//! The cells behave like those of flash: a write turns bits from 1 to 0 and never back, and an
//! erase sets a whole sector. The image therefore stores through the same `flash_log` as the board
//! to flash. The bench, which can end the emulator at any moment, finds what a power cut leaves.
//! The sectors are small so that an erase is due within a few changes.
//!
//! # Notes
//! Nothing takes time here, nothing refuses, and half-written cells keep clean bits. What a chip's
//! own controller does (locks, busy flags, the stalled bank) is only in the board to flash, and has
//! not been tried.

use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase,
    check_read, check_write,
};
use ser_board::flash_log::FlashHealth;

use crate::external_bus;

pub(crate) static HEALTH: FlashHealth = FlashHealth::new();

const WORD_LEN: usize = size_of::<u32>();
/// A marker and three records.
const SECTOR_LEN: usize = 0x400;
const _: () = assert!(external_bus::CONFIGURATION_LEN == 2 * SECTOR_LEN);

/// Both sectors as one memory.
pub(crate) struct BenchFlash(());

impl BenchFlash {
    /// # Safety
    /// Call once only: the memory belongs to the caller.
    pub(crate) const unsafe fn open() -> BenchFlash {
        BenchFlash(())
    }
}

impl ErrorType for BenchFlash {
    /// Outside the memory, or not a multiple of the access unit.
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for BenchFlash {
    const READ_SIZE: usize = WORD_LEN;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (cells, bytes) in external_bus::configuration(offset).zip(bytes.as_chunks_mut().0) {
            *bytes = cells.read().to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR_LEN
    }
}

impl NorFlash for BenchFlash {
    const WRITE_SIZE: usize = WORD_LEN;
    const ERASE_SIZE: usize = SECTOR_LEN;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        for (_, cells) in (from..to).step_by(WORD_LEN).zip(external_bus::configuration(from)) {
            cells.write(u32::MAX);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (cells, bytes) in external_bus::configuration(offset).zip(bytes.as_chunks().0) {
            cells.write(cells.read() & u32::from_le_bytes(*bytes));
        }
        Ok(())
    }
}

impl MultiwriteNorFlash for BenchFlash {}
