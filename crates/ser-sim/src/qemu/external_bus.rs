//! The desktop's view of the emulated board's external bus: the file behind its external memory.
//!
//! # Design
//! The file is mapped and used one aligned 32-bit word at a time, except for the GENI window, which
//! has bytes. Plain writes to the file would reach the board as well. But the kernel copies a few
//! bytes one by one, and an input latch that is read between two of its bytes would show a contact
//! change that never was.

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::Path;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

use geni_board::RAM_LEN;
use memmap2::MmapRaw;
use rustix::fs::OFlags;
use ser_board::last_words::MAX_TEXT_LEN;
use ser_proto::Model;

use crate::machine::non_volatile::random_id;

/// Bytes of the external memory. QEMU is told the same number.
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
/// How often the board has started, counted by the board.
const BOOT_COUNT: usize = 0x8010;
/// Bytes of its stack that it has used at most.
const STACK_BYTES: usize = 0x8014;
/// Why it started the last time.
const RESET_CAUSE: usize = 0x8018;
/// Its lamps, a bit each.
const LAMPS: usize = 0x8028;
/// The fault that it is to bring upon itself; it clears the word first.
const FORCED_FAULT: usize = 0x802C;
/// Its battery-backed clock's count: low word, high word, seal; written here.
const CLOCK_COUNT_MS: usize = 0x8030;
/// How long its last start took, in microseconds.
const BOOT_TIME_US: usize = 0x803C;
/// Its number, three words; written here when the file is made.
const RECORDER_ID: usize = 0x8050;
/// Length of what its latest fault had to say, and then the text.
const LAST_WORDS: usize = 0x8080;
/// How many starts ago the latest fault was; 0 for never.
const LAST_WORDS_AGE: usize = 0x80E0;

/// Two words that tell a file of ours from any other; written here.
const MARK: usize = 0x80F0;
/// `SER bus1`.
const MADE_BY_US: [u32; 2] = [u32::from_le_bytes(*b"SER "), u32::from_le_bytes(*b"bus1")];

/// Opens a memory that was made before; `None` where the file is something else.
fn open_memory(path: &Path) -> io::Result<Option<File>> {
    // Checked before it is opened, because opening a pipe would wait for its other end.
    if !is_memory(&fs::symlink_metadata(path)?) {
        return Ok(None);
    }
    // It may be something else by now.
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let file = File::options()
        .read(true)
        .write(true)
        .custom_flags(flags.bits().cast_signed())
        .open(path)?;
    if !is_memory(&file.metadata()?) {
        return Ok(None);
    }
    let mut mark = [0; 8];
    file.read_exact_at(&mut mark, MARK as u64)?;
    Ok((mark == *MADE_BY_US.map(u32::to_le_bytes).as_flattened()).then_some(file))
}

fn is_memory(found: &Metadata) -> bool {
    found.is_file() && found.len() == MEMORY_LEN
}

/// The mapped memory.
pub struct ExternalBus {
    memory: MmapRaw,
    file: File,
    /// When the clock's count was last written, and the longest time between two such moments; 0
    /// for never.
    clock_written_ms: AtomicU64,
    clock_gap_ms: AtomicU64,
}

impl ExternalBus {
    /// Makes the file with the size of the memory, or opens one that was made so.
    ///
    /// # Errors
    /// `AlreadyExists` where something else is, which is left as it is.
    pub fn open(path: &Path) -> io::Result<ExternalBus> {
        let bus = |file: File| {
            Ok(ExternalBus {
                memory: MmapRaw::map_raw(&file)?,
                file,
                clock_written_ms: AtomicU64::new(0),
                clock_gap_ms: AtomicU64::new(0),
            })
        };
        match File::options().read(true).write(true).create_new(true).open(path) {
            Ok(file) => {
                file.set_len(MEMORY_LEN)?;
                let bus = bus(file)?;
                (0..).step_by(4).zip(MADE_BY_US).for_each(|(at, word)| bus.write(MARK + at, word));
                for (at, word) in (0..).step_by(4).zip(random_id().as_chunks().0) {
                    bus.write(RECORDER_ID + at, u32::from_le_bytes(*word));
                }
                Ok(bus)
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                let file = open_memory(path)?.ok_or(ErrorKind::AlreadyExists)?;
                bus(file)
            }
            Err(error) => Err(error),
        }
    }

    /// The file, for the other side to map it, too.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Says which model the board is, and the debounce time of its inputs.
    pub fn set_straps(&self, model: Model, debounce_ms: u8) {
        let model = match model {
            Model::Ser160 => 160,
            Model::Ser320 => 320,
        };
        self.write(MODEL_STRAP, model);
        self.write(DEBOUNCE_STRAP, debounce_ms.into());
    }

    /// Fits a GENI board, whose shared RAM is all zeros, or takes it out.
    pub fn fit_geni(&self, fitted: bool) {
        (0..RAM_LEN).for_each(|offset| self.window_byte(offset).store(0, Ordering::SeqCst));
        self.write(GENI_STRAP, fitted.into());
    }

    /// A byte of the GENI board's shared RAM.
    pub fn read_geni(&self, offset: u16) -> u8 {
        self.window_byte(offset.into()).load(Ordering::SeqCst)
    }

    /// Writes one.
    pub fn write_geni(&self, offset: u16, byte: u8) {
        self.window_byte(offset.into()).store(byte, Ordering::SeqCst);
    }

    /// The GENI board's reset line: bit 0 is set as long as it is held, and the rest changes with
    /// every pulse.
    pub fn geni_reset(&self) -> u32 {
        self.read(GENI_RESET)
    }

    /// Moves all contacts at once.
    pub fn set_inputs(&self, inputs: u32) {
        self.write(INPUT_LATCH, inputs);
    }

    /// The inputs as the board's latest sample saw them. Its tick is not later than the counter
    /// read after this.
    pub(crate) fn sampled_inputs(&self) -> u32 {
        self.read(SAMPLED_INPUTS)
    }

    /// The tick of the board's latest sample.
    pub fn sample_counter(&self) -> u32 {
        self.read(SAMPLE_COUNTER)
    }

    /// Puts the counter back to where it is before the first sample.
    pub(crate) fn clear_sample(&self) {
        self.write(SAMPLE_COUNTER, 0);
        // What no sample can have seen.
        self.write(SAMPLED_INPUTS, !self.read(INPUT_LATCH));
    }

    /// Whether the board has taken a sample of the contacts as they are.
    pub(crate) fn is_sampled(&self) -> bool {
        self.sample_counter() != 0 && self.sampled_inputs() == self.read(INPUT_LATCH)
    }

    /// How often the board has started.
    pub fn boots(&self) -> u32 {
        self.read(BOOT_COUNT)
    }

    /// Why it started the last time, as a number.
    pub(crate) fn reset_cause(&self) -> u32 {
        self.read(RESET_CAUSE)
    }

    /// What its latest fault had to say.
    pub(crate) fn last_words(&self) -> Vec<u8> {
        let len = usize::try_from(self.read(LAST_WORDS)).unwrap_or(usize::MAX).min(MAX_TEXT_LEN);
        let words = (LAST_WORDS + 4..).step_by(4).map(|offset| self.read(offset).to_le_bytes());
        words.take(MAX_TEXT_LEN / 4).flatten().take(len).collect()
    }

    /// How many starts ago its latest fault was; 0 for never.
    pub(crate) fn last_words_age(&self) -> u32 {
        self.read(LAST_WORDS_AGE)
    }

    /// How long its last start took, in microseconds.
    pub(crate) fn boot_time_us(&self) -> u32 {
        self.read(BOOT_TIME_US)
    }

    /// Its lamps, a bit each.
    pub(crate) fn lamps(&self) -> u32 {
        self.read(LAMPS)
    }

    /// Bytes of its stack that it has used at most.
    pub(crate) fn stack_bytes(&self) -> u32 {
        self.read(STACK_BYTES)
    }

    /// Has it bring a fault upon itself.
    pub fn force(&self, fault: u32) {
        self.write(FORCED_FAULT, fault);
    }

    /// Turns its battery-backed clock on to `count_ms`. Only one thread may.
    pub fn set_clock(&self, count_ms: u64) {
        let before_ms = self.clock_written_ms.swap(count_ms, Ordering::Relaxed);
        if before_ms == count_ms {
            return;
        }
        if before_ms != 0 {
            self.clock_gap_ms.fetch_max(count_ms.saturating_sub(before_ms), Ordering::Relaxed);
        }
        let [a, b, c, d, e, f, g, h] = count_ms.to_le_bytes();
        let (low, high) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
        self.write(CLOCK_COUNT_MS, low);
        self.write(CLOCK_COUNT_MS + 4, high);
        // What the board finds half new, half old, does not fit its seal.
        self.write(CLOCK_COUNT_MS + 8, !(low ^ high.rotate_left(16)));
    }

    /// The longest time for which the clock has not been turned on.
    pub(crate) fn clock_gap_ms(&self) -> u64 {
        self.clock_gap_ms.load(Ordering::Relaxed)
    }

    #[expect(unsafe_code, reason = "memory shared with the emulator")]
    fn window_byte(&self, offset: usize) -> &AtomicU8 {
        assert!(offset < RAM_LEN && GENI_WINDOW + RAM_LEN <= self.memory.len());
        // SAFETY: the byte lies inside the mapping (asserted), which lives as long as `self`. Both
        // sides use the window byte by byte only, and any value is valid. For the file, see `word`.
        unsafe { AtomicU8::from_ptr(self.memory.as_mut_ptr().add(GENI_WINDOW + offset)) }
    }

    fn read(&self, offset: usize) -> u32 {
        u32::from_le(self.word(offset).load(Ordering::SeqCst))
    }

    pub(crate) fn write(&self, offset: usize, value: u32) {
        self.word(offset).store(value.to_le(), Ordering::SeqCst);
    }

    #[expect(unsafe_code, reason = "memory shared with the emulator")]
    fn word(&self, offset: usize) -> &AtomicU32 {
        assert!(
            offset.is_multiple_of(size_of::<AtomicU32>())
                && offset + size_of::<AtomicU32>() <= self.memory.len()
        );
        // SAFETY: the word lies inside the mapping (asserted), which lives as long as `self`; a
        // mapping begins at a page, so the word is aligned (asserted). Both sides use it as a whole
        // word only, and any value is valid. The file keeps its size: nobody but us and QEMU, which
        // does not change it, is supposed to know it.
        unsafe { AtomicU32::from_ptr(self.memory.as_mut_ptr().add(offset).cast()) }
    }
}

#[cfg(test)]
mod tests {
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
        let before = ExternalBus::open(&path).unwrap();
        (0..RAM_LEN).step_by(4).for_each(|at| before.write(at, 0xA5A5_A5A5));
        let bus = ExternalBus::open(&path).unwrap();
        bus.fit_geni(true);
        bus.write_geni(0x3FFF, 7);
        let file = fs::read(&path).unwrap();
        assert!(file[..0x3FFF].iter().all(|&byte| byte == 0));
        assert_eq!((file[0x3FFF], file[0x4000], bus.read_geni(0x3FFF)), (7, 0, 7));
        assert_eq!(file[0x8024..0x8028], [1, 0, 0, 0]);
    }

    #[test]
    fn the_clock_carries_a_seal_that_no_half_of_another_count_has() {
        let directory = tempfile::tempdir().unwrap();
        let bus = ExternalBus::open(&directory.path().join("memory")).unwrap();
        let words = || [0x8030, 0x8034, 0x8038].map(|offset| bus.read(offset));
        let is_sealed = |[low, high, seal]: [u32; 3]| seal == !(low ^ high.rotate_left(16));
        assert!(!is_sealed(words()), "a new file has no clock");
        // The low word begins anew in between.
        let counts = [0x0000_0123_FFFF_FFFF, 0x0000_0124_0000_0000];
        let [old, new] = counts.map(|count_ms| {
            bus.set_clock(count_ms);
            words()
        });
        assert_eq!(u64::from(new[1]) << 32 | u64::from(new[0]), counts[1]);
        for mix in 0..8_u32 {
            let mixed: [u32; 3] =
                std::array::from_fn(
                    |word| if mix >> word & 1 == 0 { old[word] } else { new[word] },
                );
            assert_eq!(is_sealed(mixed), mix == 0 || mix == 7, "{mix:03b}");
        }
        assert_eq!(bus.clock_gap_ms(), 1);
    }

    #[test]
    fn somebody_elses_file_is_left_alone_whatever_its_size() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("photo");
        for len in [0, 1, MEMORY_LEN] {
            fs::write(&path, vec![0xA5; usize::try_from(len).unwrap()]).unwrap();
            let refused = ExternalBus::open(&path).err().map(|error| error.kind());
            assert_eq!(refused, Some(ErrorKind::AlreadyExists), "{len}");
            let file = fs::read(&path).unwrap();
            assert!(file.len() as u64 == len && file.iter().all(|&byte| byte == 0xA5));
        }
        let (memory, link) = (directory.path().join("memory"), directory.path().join("link"));
        std::os::unix::fs::symlink(&memory, &link).unwrap();
        for _ in 0..2 {
            assert!(ExternalBus::open(&link).is_err());
            ExternalBus::open(&memory).unwrap();
        }
    }

    #[test]
    fn what_a_file_holds_already_is_kept() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("memory");
        ExternalBus::open(&path).unwrap().write(0x9000, 7);
        assert_eq!(ExternalBus::open(&path).unwrap().word(0x9000).load(Ordering::SeqCst), 7);
    }
}
