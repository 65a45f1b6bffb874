//! The configuration in flash memory. Each of the two copies has a sector of its own, filled record
//! by record.
//!
//! ```text
//! slot   0         1         2         3
//!     |  marker | record  | record  | erased … |      16 bytes each; the last one in use is the copy
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
//! 10 000 erases each last for 20 million changes.
//!
//! # Notes
//! A sector of 16 KiB takes 1023 records, one of 128 KiB 8191. The copies take turns, so an erase
//! is due once in as many changes, and with the very first change of each copy. On an STM32F4 it
//! takes 250–500 ms for 16 KiB and 1–2 s for 128 KiB (data sheet, "Flash memory programming", 32
//! bits at a time). Nothing can be read from that bank until the erase is done: code that runs from
//! it stands still, interrupts included. There are two ways out. Either the capture interrupt, all
//! that it calls and the vector table are in RAM; capture then goes on while the main loop waits,
//! and its queue takes 256 changes. Or the samples of that time are missed, and `ser_node` counts
//! them. The board feeds its watchdog meanwhile. Writing a record takes 16 bytes of at most 100 µs
//! each.

use core::sync::atomic::{AtomicBool, Ordering};

use embedded_storage::nor_flash::MultiwriteNorFlash;
use ser_node::{CopyNumber, RECORD_LEN, Storage};

use crate::counter::Counter;

/// Content of slot 0 in a sector whose erase was completed.
const MARKER: [u8; RECORD_LEN] = *b"SER settings 1\r\n";
const CLEARED: [u8; RECORD_LEN] = [0; RECORD_LEN];
const ERASED: u8 = 0xFF;

#[expect(clippy::cast_possible_truncation, reason = "16")]
const SLOT_LEN: u32 = RECORD_LEN as u32;

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
        assert!(
            RECORD_LEN.is_multiple_of(F::WRITE_SIZE) && RECORD_LEN.is_multiple_of(F::READ_SIZE)
        );
        assert!(F::ERASE_SIZE <= i32::MAX as usize);
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let sector_len = F::ERASE_SIZE as u32;
        sector_len / SLOT_LEN
    };

    /// Configurations that one sector takes before it is erased.
    pub const RECORDS_PER_SECTOR: u32 = Self::SLOTS - 1;

    const SECTOR_LEN: u32 = Self::SLOTS * SLOT_LEN;

    /// The first copy in the first sector of `flash`, the second one in the second. Nothing is
    /// touched yet. A memory that is smaller answers with an error of its own when it is.
    pub const fn new(flash: F, health: &'a FlashHealth) -> Self {
        FlashLog { flash, health }
    }

    /// How many configurations find room in the sector of `copy` before it has to be erased: 0 when
    /// that is due.
    ///
    /// # Errors
    /// When the memory cannot be read.
    pub fn records_left(&mut self, copy: CopyNumber) -> Result<u32, F::Error> {
        let used = self.slots_used(Self::sector(copy))?;
        Ok(used.map_or(0, |used| Self::SLOTS - used))
    }

    /// Where the sector of a copy begins.
    const fn sector(copy: CopyNumber) -> u32 {
        match copy {
            CopyNumber::First => 0,
            CopyNumber::Second => Self::SECTOR_LEN,
        }
    }

    #[inline]
    fn slot(&mut self, sector: u32, slot: u32) -> Result<[u8; RECORD_LEN], F::Error> {
        let mut content = [0; RECORD_LEN];
        self.flash.read(sector + slot * SLOT_LEN, &mut content)?;
        Ok(content)
    }

    /// Slots up to the last one in use, the marker's included; `None` when the sector has to be
    /// erased first.
    fn slots_used(&mut self, sector: u32) -> Result<Option<u32>, F::Error> {
        if self.slot(sector, 0)? != MARKER {
            return Ok(None);
        }
        // From the end: behind a record that was cut short there may be nothing, in front of it
        // there are only records. Not by halves: one that was cut short may hold bits that read now
        // so, now so, and must not hide those that came after it.
        for slot in (1..Self::SLOTS).rev() {
            // As one number: in a sector with few records this is most of what a start does.
            if u128::from_ne_bytes(self.slot(sector, slot)?) != u128::MAX {
                return Ok(Some(slot + 1));
            }
        }
        Ok(Some(1))
    }

    fn newest(&mut self, copy: CopyNumber) -> Result<[u8; RECORD_LEN], F::Error> {
        let sector = Self::sector(copy);
        match self.slots_used(sector)? {
            Some(used) if used > 1 => self.slot(sector, used - 1),
            _ => Ok([ERASED; RECORD_LEN]),
        }
    }

    fn append(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), F::Error> {
        let sector = Self::sector(copy);
        let slot = match self.slots_used(sector)? {
            Some(used) if used < Self::SLOTS => used,
            _ => {
                self.erase(sector)?;
                1
            }
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
        let newest = self.newest(copy);
        *record = self.health.note(newest)?;
        Ok(())
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), F::Error> {
        let written = self.append(copy, record);
        self.health.note(written)
    }
}
