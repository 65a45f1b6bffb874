//! Flash memory as in an STM32F4, whose power can fail at any single write.
//!
//! Writing turns bits from 1 to 0; only erasing a whole sector turns them back. Power is a budget
//! of steps: each byte written is a step, and so is each part of an erase. When the budget runs
//! out, the current step is done in part, and nothing works any more until [`Flash::power_up`].

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use oorandom::Rand64;

/// Steps of an erase: cells lose their contents little by little.
const ERASE_STEPS: usize = 8;

/// Memory of `SECTOR` bytes per erase and `WORD` bytes per write. Clones are the same memory.
#[derive(Clone)]
pub(crate) struct Flash<const SECTOR: usize, const WORD: usize>(Rc<RefCell<Cells>>);

#[derive(Clone)]
struct Cells {
    bytes: Vec<u8>,
    erased: Vec<u32>,
    /// Sectors whose erase was cut short. Nothing written there would last, whatever their cells
    /// seem to hold.
    weak: Vec<bool>,
    /// Steps until the power fails; `None` when it does not.
    power: Option<u64>,
    steps: u64,
    noise: Rand64,
}

/// The power has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PowerCut;

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const SECTOR: usize, const WORD: usize> Flash<SECTOR, WORD> {
    pub(crate) fn new(sectors: usize) -> Self {
        Flash(Rc::new(RefCell::new(Cells {
            bytes: vec![0xFF; sectors * SECTOR],
            erased: vec![0; sectors],
            weak: vec![false; sectors],
            power: None,
            steps: 0,
            noise: Rand64::new(0),
        })))
    }

    /// A separate memory with the same contents, and with power.
    pub(crate) fn copy(&self) -> Self {
        let copy = Flash(Rc::new(RefCell::new(self.0.borrow().clone())));
        copy.power_up();
        copy
    }

    /// Makes the power fail in the step after that many.
    pub(crate) fn cut_after(&self, steps: u64, seed: u64) {
        let mut cells = self.0.borrow_mut();
        cells.power = Some(steps);
        cells.sow(seed);
    }

    pub(crate) fn power_up(&self) {
        self.0.borrow_mut().power = None;
    }

    /// Fills the memory as if it had been used for something else.
    pub(crate) fn fill_with_noise(&self, seed: u64) {
        let mut cells = self.0.borrow_mut();
        cells.sow(seed);
        for at in 0..cells.bytes.len() {
            cells.bytes[at] = cells.noise();
        }
    }

    /// Steps done so far.
    pub(crate) fn steps(&self) -> u64 {
        self.0.borrow().steps
    }

    /// How often each sector was erased.
    pub(crate) fn erased(&self) -> Vec<u32> {
        self.0.borrow().erased.clone()
    }
}

impl Cells {
    /// Makes everything left to chance depend on `seed` alone.
    fn sow(&mut self, seed: u64) {
        self.noise = Rand64::new(seed.into());
    }

    fn noise(&mut self) -> u8 {
        let [byte, ..] = self.noise.rand_u64().to_le_bytes();
        byte
    }

    /// Whether there is power for another step.
    fn step(&mut self) -> bool {
        match &mut self.power {
            Some(0) => false,
            Some(left) => {
                *left -= 1;
                self.steps += 1;
                true
            }
            None => {
                self.steps += 1;
                true
            }
        }
    }

    fn has_power(&self) -> Result<(), PowerCut> {
        if self.power == Some(0) { Err(PowerCut) } else { Ok(()) }
    }

    fn write(&mut self, at: usize, new: u8) -> Result<(), PowerCut> {
        let old = self.bytes[at];
        assert_eq!(new & !old, 0, "writing {new:02x} over {old:02x} at {at:x}h needs an erase");
        if self.step() {
            self.bytes[at] = new;
            return Ok(());
        }
        // Some of the bits that were to become 0 have done so.
        self.bytes[at] = old & (new | self.noise());
        Err(PowerCut)
    }

    /// Takes all cells of a sector part of the way to 1; the last step completes it.
    fn erase(&mut self, from: usize, to: usize) -> Result<(), PowerCut> {
        for step in 1..=ERASE_STEPS {
            if !self.step() {
                return Err(PowerCut);
            }
            for at in from..to {
                let risen = if step == ERASE_STEPS { 0xFF } else { self.noise() & self.noise() };
                self.bytes[at] |= risen;
            }
        }
        Ok(())
    }
}

impl<const SECTOR: usize, const WORD: usize> ErrorType for Flash<SECTOR, WORD> {
    type Error = PowerCut;
}

impl<const SECTOR: usize, const WORD: usize> ReadNorFlash for Flash<SECTOR, WORD> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        let cells = self.0.borrow();
        cells.has_power()?;
        let offset = offset as usize;
        bytes.copy_from_slice(&cells.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.borrow().bytes.len()
    }
}

impl<const SECTOR: usize, const WORD: usize> NorFlash for Flash<SECTOR, WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        let mut cells = self.0.borrow_mut();
        let (from, to) = (from as usize, to as usize);
        assert!(
            from.is_multiple_of(SECTOR) && to.is_multiple_of(SECTOR) && from < to,
            "not whole sectors"
        );
        for sector in from / SECTOR..to / SECTOR {
            cells.has_power()?;
            cells.erased[sector] += 1;
            cells.weak[sector] = true;
            cells.erase(sector * SECTOR, (sector + 1) * SECTOR)?;
            cells.weak[sector] = false;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        let mut cells = self.0.borrow_mut();
        let offset = offset as usize;
        assert!(offset.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD), "not whole words");
        let is_weak = cells.weak[offset / SECTOR];
        assert!(
            !is_weak || bytes.iter().all(|&byte| byte == 0),
            "writing to a sector that is not erased"
        );
        for (at, &byte) in (offset..).zip(bytes) {
            cells.write(at, byte)?;
        }
        Ok(())
    }
}

impl<const SECTOR: usize, const WORD: usize> MultiwriteNorFlash for Flash<SECTOR, WORD> {}
