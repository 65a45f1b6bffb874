//! The desktop's view of the emulated board's external bus: the file behind its external memory.
//!
//! # Design
//! The file is mapped and used one aligned 32-bit word at a time, except for the GENI window, which has bytes. Plain writes
//! to the file would show up on the board as well, but the kernel copies a few bytes one by one, and an input latch
//! caught between two of its bytes would be a contact change that never was.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use geni::RAM_LEN;
use memmap2::MmapRaw;
use ser_proto::Model;

/// Bytes of the external memory; QEMU is told the same.
pub(crate) const MEMORY_LEN: u64 = 16 << 20;

/// The GENI board's shared RAM, byte by byte.
const GENI_WINDOW: usize = 0x0000;
/// The GENI board's reset line, written by the board.
const GENI_RESET: usize = 0x801C;
/// Whether there is a GENI board; read by the board at boot.
const GENI_STRAP: usize = 0x8024;
/// Inputs, input 1 in bit 0; written here.
const INPUT_LATCH: usize = 0x8000;
/// The tick of the latest sample, written by the board once it has been taken.
const SAMPLE_COUNTER: usize = 0x8004;
/// The inputs as the latest sample saw them, written by the board after the counter.
const SAMPLED_INPUTS: usize = 0x8020;
/// 160 or 320; read by the board at boot.
const MODEL_STRAP: usize = 0x8008;
/// Milliseconds for all inputs; read by the board at boot.
const DEBOUNCE_STRAP: usize = 0x800C;

/// The mapped memory.
pub(crate) struct ExternalBus {
    memory: MmapRaw,
}

impl ExternalBus {
    /// Opens the file, makes it if need be, and gives it the size of the memory.
    pub(crate) fn open(path: &Path) -> io::Result<ExternalBus> {
        let file: File = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        if file.metadata()?.len() != MEMORY_LEN {
            file.set_len(MEMORY_LEN)?;
        }
        Ok(ExternalBus { memory: MmapRaw::map_raw(&file)? })
    }

    pub(crate) fn set_straps(&self, model: Model, debounce_ms: u8) {
        let model = match model {
            Model::Ser160 => 160,
            Model::Ser320 => 320,
        };
        self.write(MODEL_STRAP, model);
        self.write(DEBOUNCE_STRAP, debounce_ms.into());
    }

    /// Fits a GENI board, whose shared RAM is all zeros, or takes it out.
    pub(crate) fn fit_geni(&self, fitted: bool) {
        (0..RAM_LEN).for_each(|offset| self.window_byte(offset).store(0, Ordering::SeqCst));
        self.write(GENI_STRAP, fitted.into());
    }

    /// A byte of the GENI board's shared RAM.
    pub(crate) fn read_geni(&self, offset: u16) -> u8 {
        self.window_byte(offset.into()).load(Ordering::SeqCst)
    }

    /// Writes one.
    pub(crate) fn write_geni(&self, offset: u16, byte: u8) {
        self.window_byte(offset.into()).store(byte, Ordering::SeqCst);
    }

    /// The GENI board's reset line: bit 0 is set as long as it is held, and the rest changes with every pulse.
    pub(crate) fn geni_reset(&self) -> u32 {
        u32::from_le(self.word(GENI_RESET).load(Ordering::SeqCst))
    }

    /// Moves all contacts at once.
    pub(crate) fn set_inputs(&self, inputs: u32) {
        self.write(INPUT_LATCH, inputs);
    }

    /// The inputs as the board's latest sample saw them. Its tick is not later than the counter read after this.
    pub(crate) fn sampled_inputs(&self) -> u32 {
        u32::from_le(self.word(SAMPLED_INPUTS).load(Ordering::SeqCst))
    }

    /// The tick of the board's latest sample.
    pub(crate) fn sample_counter(&self) -> u32 {
        u32::from_le(self.word(SAMPLE_COUNTER).load(Ordering::SeqCst))
    }

    /// Puts the counter back to where it is before the first sample.
    pub(crate) fn clear_sample(&self) {
        self.write(SAMPLE_COUNTER, 0);
        // What no sample can have seen.
        self.write(SAMPLED_INPUTS, !u32::from_le(self.word(INPUT_LATCH).load(Ordering::SeqCst)));
    }

    /// Whether the board has taken a sample of the contacts as they are.
    pub(crate) fn is_sampled(&self) -> bool {
        self.sample_counter() != 0
            && self.sampled_inputs() == u32::from_le(self.word(INPUT_LATCH).load(Ordering::SeqCst))
    }

    #[expect(unsafe_code, reason = "memory shared with the emulator")]
    fn window_byte(&self, offset: usize) -> &AtomicU8 {
        assert!(offset < RAM_LEN && GENI_WINDOW + RAM_LEN <= self.memory.len());
        // SAFETY: the byte lies inside the mapping (asserted), which lives as long as `self`. Both sides use the window
        // byte by byte only, and any value is valid. For the file, see `word`.
        unsafe { AtomicU8::from_ptr(self.memory.as_mut_ptr().add(GENI_WINDOW + offset)) }
    }

    fn write(&self, offset: usize, value: u32) {
        self.word(offset).store(value.to_le(), Ordering::SeqCst);
    }

    #[expect(unsafe_code, reason = "memory shared with the emulator")]
    fn word(&self, offset: usize) -> &AtomicU32 {
        assert!(
            offset.is_multiple_of(size_of::<AtomicU32>())
                && offset + size_of::<AtomicU32>() <= self.memory.len()
        );
        // SAFETY: the word lies inside the mapping (asserted), which lives as long as `self`; a mapping begins at a
        // page, so the word is aligned (asserted). Both sides use it as a whole word only, and any value is valid.
        // The file keeps its size: nobody but us and QEMU, which does not change it, is supposed to know it.
        unsafe { AtomicU32::from_ptr(self.memory.as_mut_ptr().add(offset).cast()) }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn words_stand_in_the_file_where_the_board_looks_for_them() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("memory");
        let bus = ExternalBus::open(&path).unwrap();
        bus.set_straps(Model::Ser160, 20);
        bus.set_inputs(0x8001_0203);
        let file = fs::read(&path).unwrap();
        assert_eq!(file.len() as u64, MEMORY_LEN);
        assert_eq!(file[0x8000..0x8010], [3, 2, 1, 0x80, 0, 0, 0, 0, 160, 0, 0, 0, 20, 0, 0, 0]);
    }

    #[test]
    fn the_geni_window_is_the_beginning_of_the_file_and_begins_as_zeros() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("memory");
        fs::write(&path, [0xA5; RAM_LEN]).unwrap();
        let bus = ExternalBus::open(&path).unwrap();
        bus.fit_geni(true);
        bus.write_geni(0x3FFF, 7);
        let file = fs::read(&path).unwrap();
        assert!(file[..0x3FFF].iter().all(|&byte| byte == 0));
        assert_eq!((file[0x3FFF], file[0x4000], bus.read_geni(0x3FFF)), (7, 0, 7));
        assert_eq!(file[0x8024..0x8028], [1, 0, 0, 0]);
    }

    #[test]
    fn what_a_file_holds_already_is_kept() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("memory");
        ExternalBus::open(&path).unwrap().write(0x9000, 7);
        assert_eq!(ExternalBus::open(&path).unwrap().word(0x9000).load(Ordering::SeqCst), 7);
    }
}
