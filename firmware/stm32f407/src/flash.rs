//! The configuration's flash: sectors 2 and 3, 16 KiB each.
//!
//! # Design
//! Everything runs from RAM, so erasing and writing stop nothing: capture and the serial interrupts
//! go on, and the main loop waits here. While it waits for an erase it feeds the watchdog, as long
//! as capture makes progress and the erase stays within its time limit.
//!
//! # Notes
//! Writes are 32 bits at a time, which requires 2.7 V at least. The brown-out reset must therefore
//! be at its highest level; `reset` logs a warning if it is not. Times (data sheet, "Flash memory
//! programming"): 250–500 ms to erase a sector of 16 KiB, 16–100 µs to write a word.

use core::arch::global_asm;
use core::ptr;

use cortex_m::asm;
use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
    check_erase, check_read, check_write,
};
use ser_board::flash_log::FlashHealth;
use ser_node::Liveness;
use stm32f4::stm32f407::FLASH;

use crate::timer;
use crate::watchdog::Watchdog;

/// Start of sector 2. ram-image.x keeps the image away from it, and does not link if the two
/// differ.
pub(crate) const BASE: u32 = 0x0800_8000;
/// Sectors 2 and 3.
pub(crate) const LEN: u32 = 2 * SECTOR_LEN;

global_asm!(
    ".global FLASH_RS_BASE",
    ".set FLASH_RS_BASE, {base}",
    ".global FLASH_RS_LEN",
    ".set FLASH_RS_LEN, {len}",
    base = const BASE,
    len = const LEN,
);

const SECTOR_LEN: u32 = 0x4000;
const FIRST_SECTOR: u8 = 2;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// 32 bits at a time.
const WORD_LEN: usize = 4;

/// Twice the data sheet's maximum for an erase.
const ERASE_MAX_MS: u32 = 1000;
/// Looks at a write before it is given up, some ten clocks each: a millisecond.
const WRITE_LOOKS: u32 = 8400;

pub(crate) static HEALTH: FlashHealth = FlashHealth::new();

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FlashError {
    /// Outside the memory, or not a multiple of the access unit.
    Range(NorFlashErrorKind),
    /// The operation has not ended in time.
    TimedOut,
    /// The controller has refused or aborted the operation.
    Refused,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            FlashError::Range(kind) => *kind,
            FlashError::TimedOut | FlashError::Refused => NorFlashErrorKind::Other,
        }
    }
}

/// Both sectors as one memory.
pub(crate) struct ConfigurationFlash {
    registers: FLASH,
    watchdog: Watchdog,
}

impl ConfigurationFlash {
    pub(crate) const fn new(registers: FLASH, watchdog: Watchdog) -> ConfigurationFlash {
        ConfigurationFlash { registers, watchdog }
    }

    /// Unlocks the flash while `change` runs, and checks whether it went well.
    fn change(
        &mut self,
        change: impl FnOnce(&mut Self) -> Result<(), FlashError>,
    ) -> Result<(), FlashError> {
        // While the flash is at work, a write to its registers stalls the bus, and capture with it.
        if self.is_busy() {
            return Err(FlashError::TimedOut);
        }
        // A change that timed out has left the flash unlocked.
        self.registers.cr().write(|w| w.lock().set_bit());
        for key in KEYS {
            // SAFETY: the key register takes any value.
            self.registers.keyr().write(|w| unsafe { w.bits(key) });
        }
        // Errors of an earlier change must not count against this one.
        self.registers.sr().write(|w| {
            w.pgserr().clear_bit_by_one().pgperr().clear_bit_by_one().pgaerr().clear_bit_by_one();
            w.wrperr().clear_bit_by_one().operr().clear_bit_by_one().eop().clear_bit_by_one()
        });
        let changed = change(self);
        if self.is_busy() {
            return changed;
        }
        let status = self.registers.sr().read();
        let refused = status.pgserr().bit_is_set()
            || status.pgperr().bit_is_set()
            || status.pgaerr().bit_is_set()
            || status.wrperr().bit_is_set();
        // Also ends a started operation: all other bits of the register become zero.
        self.registers.cr().write(|w| w.lock().set_bit());
        changed.and(if refused { Err(FlashError::Refused) } else { Ok(()) })
    }

    fn is_busy(&self) -> bool {
        self.registers.sr().read().bsy().bit_is_set()
    }

    fn erase_sector(&mut self, number: u8) -> Result<(), FlashError> {
        // SAFETY: the sector is one of the configuration's.
        self.registers
            .cr()
            .modify(|_, w| unsafe { w.psize().psize32().ser().set_bit().snb().bits(number) });
        self.registers.cr().modify(|_, w| w.strt().set_bit());
        let started_ms = timer::tick_ms();
        let mut liveness = Liveness::new();
        while self.is_busy() {
            let now_ms = timer::tick_ms();
            if now_ms.wrapping_sub(started_ms) > ERASE_MAX_MS {
                return Err(FlashError::TimedOut);
            }
            if liveness.pass(now_ms) {
                self.watchdog.feed();
            }
        }
        Ok(())
    }

    /// Writes the word at `offset`, a multiple of four less than `LEN`, into flash that is unlocked
    /// and idle.
    fn write_word(&mut self, offset: u32, word: u32) -> Result<(), FlashError> {
        self.registers.cr().modify(|_, w| w.psize().psize32().pg().set_bit());
        // SAFETY: as memory, nothing else uses the word. ram-image.x assigns sectors 2 and 3 to no
        // section, and does not link if these are other sectors: no variable and no code is there.
        // No reference to it is ever formed. Only `read` reads it, through this value, which exists
        // once and is borrowed for writing. It is aligned and inside the sectors (`check_write` has
        // checked the whole range), where the protection unit grants access. As hardware, unlocked
        // flash takes a store of 32 bits with PG set and PSIZE at 32 bits. Whatever bits are
        // written over whatever others, the worst is a cell that holds something else, and the
        // record's check finds that. Nothing can be read from the bank meanwhile, which stops
        // nothing: everything runs from RAM.
        unsafe { ptr::write_volatile(address(offset).cast::<u32>(), word) };
        asm::dsb();
        if (0..WRITE_LOOKS).any(|_| !self.is_busy()) { Ok(()) } else { Err(FlashError::TimedOut) }
    }
}

/// Address of the byte at `offset`.
fn address(offset: u32) -> *mut u8 {
    ptr::with_exposed_provenance_mut((BASE + offset) as usize)
}

impl ErrorType for ConfigurationFlash {
    type Error = FlashError;
}

impl ReadNorFlash for ConfigurationFlash {
    /// Reads by words, as writes do. Finding the newest record is most of the work of a start.
    const READ_SIZE: usize = WORD_LEN;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check_read(self, offset, bytes.len()).map_err(FlashError::Range)?;
        // A load from a bank that is at work stalls the bus until the bank is done, and capture
        // with it.
        if self.is_busy() {
            return Err(FlashError::TimedOut);
        }
        for (offset, word) in (offset..).step_by(WORD_LEN).zip(bytes.as_chunks_mut().0) {
            // SAFETY: inside the memory and aligned, as just checked; see `write_word` for why
            // nothing else uses it. Any value is a word.
            *word = unsafe { ptr::read_volatile(address(offset).cast::<u32>()) }.to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        LEN as usize
    }
}

impl NorFlash for ConfigurationFlash {
    const WRITE_SIZE: usize = WORD_LEN;
    const ERASE_SIZE: usize = SECTOR_LEN as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check_erase(self, from, to).map_err(FlashError::Range)?;
        let mut sector = from;
        while sector < to {
            #[expect(clippy::cast_possible_truncation, reason = "there are two")]
            let number = FIRST_SECTOR + (sector / SECTOR_LEN) as u8;
            self.change(|flash| flash.erase_sector(number))?;
            sector += SECTOR_LEN;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len()).map_err(FlashError::Range)?;
        self.change(|flash| {
            for (offset, bytes) in (offset..).step_by(WORD_LEN).zip(bytes.as_chunks().0) {
                flash.write_word(offset, u32::from_le_bytes(*bytes))?;
            }
            Ok(())
        })
    }
}

/// A bit that is 0 stays 0, and the others may be cleared by later writes: there is no check word
/// beside the data.
impl MultiwriteNorFlash for ConfigurationFlash {}
