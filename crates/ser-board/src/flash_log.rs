//! The configuration in flash memory. Each of the two copies has a sector of its own, filled record
//! by record.
//!
//! ```text
//! slot   0         1         2         3
//!     |  marker | record  | record  | erased … |     256 bytes each; the last one in use is the copy
//! ```
//!
//! # Design
//! Saving writes the next slot. A sector is erased only when it is full, while the newest
//! configuration stands in the other sector. The marker is cleared before an erase and written
//! after it. A sector whose erase was cut short is therefore erased again before anything is
//! written to it, whatever its cells seem to hold. `ser_node` checks and numbers the records, and
//! decides which of them is intact and which is newer.
//!
//! # Tradeoffs
//! `sequential-storage`, a general store for keys and values, reads every record of a sector to
//! find the last. It takes six times the code, brings panicking paths into the image, and needs two
//! sectors of one size for each copy that has sectors of its own. Of the four sectors of 16 KiB on
//! an STM32F407, the first has to hold the vector table. Here there is one value of one length,
//! which brings its own check and number, so a log of slots is enough. Two sectors of 16 KiB with
//! 10 000 erases each last for 1.2 million records.
//!
//! # Notes
//! A sector of 16 KiB takes 63 records, one of 128 KiB 511. The copies take turns, so an erase is
//! due once in as many records, and with the very first one of each copy. On an STM32F4 it
//! takes 250–500 ms for 16 KiB and 1–2 s for 128 KiB (data sheet, "Flash memory programming", 32
//! bits at a time). Nothing can be read from that bank until the erase is done: code that runs from
//! it stands still, interrupts included. There are two ways out. Either the capture interrupt, all
//! that it calls and the vector table are in RAM; capture then goes on while the main loop waits,
//! and its queue takes 256 changes. Or the samples of that time are missed, and `ser_node` counts
//! them. The board feeds its watchdog meanwhile. Writing a record takes 64 words of at most 100 µs
//! each.
//!
//! Before records had 256 bytes, they had 16, behind a marker of their own. Such a sector is read,
//! and is erased before anything is written to it.

use core::sync::atomic::{AtomicBool, Ordering};

use embedded_storage::nor_flash::MultiwriteNorFlash;
use ser_node::{CopyNumber, RECORD_LEN, Storage};

use crate::counter::Counter;

/// How slot 0 begins in a sector whose erase was completed.
const MARKER: Piece = *b"SER settings 2\r\n";
/// The same where records have the length of a piece.
const OLD_MARKER: Piece = *b"SER settings 1\r\n";
const CLEARED: Piece = [0; PIECE_LEN];
const ERASED: u8 = 0xFF;

/// What is looked at in one go.
type Piece = [u8; PIECE_LEN];
const PIECE_LEN: usize = 16;

#[expect(clippy::cast_possible_truncation, reason = "256")]
const SLOT_LEN: u32 = RECORD_LEN as u32;
#[expect(clippy::cast_possible_truncation, reason = "16")]
const OLD_SLOT_LEN: u32 = PIECE_LEN as u32;
const _: () = assert!(RECORD_LEN.is_multiple_of(PIECE_LEN));

/// Counts that the storage shares with the board; for a static.
#[derive(Debug, Default)]
pub struct FlashHealth {
    /// Records written.
    pub writes: Counter,
    /// Sectors erased.
    pub erases: Counter,
    /// Accesses that failed.
    pub failed: Counter,
    failing: AtomicBool,
}

impl FlashHealth {
    /// Nothing has been written yet.
    #[must_use]
    pub const fn new() -> FlashHealth {
        FlashHealth {
            writes: Counter::new(),
            erases: Counter::new(),
            failed: Counter::new(),
            failing: AtomicBool::new(false),
        }
    }

    /// Whether the latest access failed.
    #[must_use]
    pub fn is_failing(&self) -> bool {
        self.failing.load(Ordering::Relaxed)
    }

    fn note<T, E>(&self, result: Result<T, E>) -> Result<T, E> {
        if result.is_err() {
            self.failed.count();
        }
        self.failing.store(result.is_err(), Ordering::Relaxed);
        result
    }
}

/// The first two sectors of a flash memory as the recorder's [`Storage`].
pub struct FlashLog<'a, F> {
    flash: F,
    health: &'a FlashHealth,
}

impl<'a, F: MultiwriteNorFlash> FlashLog<'a, F> {
    /// Slots of a sector, including the marker's.
    const SLOTS: u32 = {
        assert!(F::ERASE_SIZE.is_multiple_of(RECORD_LEN) && F::ERASE_SIZE >= 2 * RECORD_LEN);
        assert!(PIECE_LEN.is_multiple_of(F::WRITE_SIZE) && PIECE_LEN.is_multiple_of(F::READ_SIZE));
        assert!(F::ERASE_SIZE <= i32::MAX as usize);
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let sector_len = F::ERASE_SIZE as u32;
        sector_len / SLOT_LEN
    };

    /// Records that one sector takes before it is erased.
    pub const RECORDS_PER_SECTOR: u32 = Self::SLOTS - 1;

    const SECTOR_LEN: u32 = Self::SLOTS * SLOT_LEN;

    /// The first copy in the first sector of `flash`, the second one in the second. Nothing is
    /// touched yet. A memory that is smaller answers with an error of its own when it is.
    pub const fn new(flash: F, health: &'a FlashHealth) -> Self {
        FlashLog { flash, health }
    }

    /// How many records find room in the sector of `copy` before it has to be erased: 0 when
    /// that is due.
    ///
    /// # Errors
    /// When the memory cannot be read.
    pub fn records_left(&mut self, copy: CopyNumber) -> Result<u32, F::Error> {
        let sector = Self::sector(copy);
        match self.piece(sector)? {
            MARKER => Ok(Self::SLOTS - self.slots_used(sector, SLOT_LEN)?),
            _ => Ok(0),
        }
    }

    /// Where the sector of a copy begins.
    const fn sector(copy: CopyNumber) -> u32 {
        match copy {
            CopyNumber::First => 0,
            CopyNumber::Second => Self::SECTOR_LEN,
        }
    }

    #[inline]
    fn piece(&mut self, offset: u32) -> Result<Piece, F::Error> {
        let mut content = [0; PIECE_LEN];
        self.flash.read(offset, &mut content)?;
        Ok(content)
    }

    fn is_erased(&mut self, from: u32, len: u32) -> Result<bool, F::Error> {
        for offset in (from..from + len).step_by(PIECE_LEN) {
            // As one number: in a sector with few records this is most of what a start does.
            if u128::from_ne_bytes(self.piece(offset)?) != u128::MAX {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Slots up to the last one in use, the marker's included.
    fn slots_used(&mut self, sector: u32, slot_len: u32) -> Result<u32, F::Error> {
        // From the end: behind a record that was cut short there may be nothing, in front of it
        // there are only records. Not by halves: one that was cut short may hold bits that read now
        // so, now so, and must not hide those that came after it.
        for slot in (1..Self::SECTOR_LEN / slot_len).rev() {
            if !self.is_erased(sector + slot * slot_len, slot_len)? {
                return Ok(slot + 1);
            }
        }
        Ok(1)
    }

    /// Reads the newest record of a copy. A short one is followed by what erased memory holds.
    fn newest(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), F::Error> {
        let sector = Self::sector(copy);
        record.fill(ERASED);
        let slot_len = match self.piece(sector)? {
            MARKER => SLOT_LEN,
            OLD_MARKER => OLD_SLOT_LEN,
            _ => return Ok(()),
        };
        let used = self.slots_used(sector, slot_len)?;
        match record.get_mut(..slot_len as usize) {
            Some(record) if used > 1 => self.flash.read(sector + (used - 1) * slot_len, record),
            _ => Ok(()),
        }
    }

    fn append(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), F::Error> {
        let sector = Self::sector(copy);
        let used = match self.piece(sector)? {
            MARKER => self.slots_used(sector, SLOT_LEN)?,
            _ => Self::SLOTS,
        };
        let slot = if used < Self::SLOTS {
            used
        } else {
            self.erase(sector)?;
            1
        };
        self.health.writes.count();
        self.flash.write(sector + slot * SLOT_LEN, record)
    }

    fn erase(&mut self, sector: u32) -> Result<(), F::Error> {
        self.health.erases.count();
        self.flash.write(sector, &CLEARED)?;
        self.flash.erase(sector, sector + Self::SECTOR_LEN)?;
        self.flash.write(sector, &MARKER)
    }
}

impl<F: MultiwriteNorFlash> Storage for FlashLog<'_, F> {
    type Error = F::Error;

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), F::Error> {
        let read = self.newest(copy, record);
        self.health.note(read)
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), F::Error> {
        let written = self.append(copy, record);
        self.health.note(written)
    }
}
