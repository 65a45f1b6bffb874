//! The external bus: GENI board, field inputs, straps, lamps, clock, marks for the bench,
//! configuration memory.
//!
//! | offset        | what                                                   | written by |
//! |---------------|--------------------------------------------------------|------------|
//! | 0000h–3FFFh   | shared RAM window of the GENI board                    | both       |
//! | 8000h         | input latch, input 1 in bit 0                          | bench      |
//! | 8004h         | sample counter: tick of the latest sample, in ms       | recorder   |
//! | 8008h         | model strap: 160 for SER160, anything else is SER320   | bench      |
//! | 800Ch         | debounce strap: ms for every input, 0–255, low byte    | bench      |
//! | 8010h         | boot count, since the file was made                    | recorder   |
//! | 8014h         | bytes of the stack in use at most since the latest     | recorder   |
//! |               | boot, looked at once a second                          |            |
//! | 8018h         | cause of the latest boot                               | recorder   |
//! | 801Ch         | reset line of the GENI board: bit 0 is set as long as  | recorder   |
//! |               | it is held; the bits above count how often it was held |            |
//! | 8020h         | the inputs as the latest sample saw them               | recorder   |
//! | 8024h         | GENI strap: 0 for no board, anything else for a board  | bench      |
//! | 8028h         | lamps: run, event, communication, fault in bits 0–3    | recorder   |
//! | 802Ch         | fault that is forced, 0 for none                       | both       |
//! | 8030h–8038h   | battery-backed clock, its count in ms: low, high, seal | bench      |
//! | 803Ch         | how long the latest boot took: from reset until inputs | recorder   |
//! |               | are sampled, in µs                                     |            |
//! | 8040h–8048h   | what the clock shows in ms since 1970, less its count: | recorder   |
//! |               | low, high, seal                                        |            |
//! | 8050h–805Bh   | number of the recorder, 12 bytes                       | bench      |
//! | 8080h         | length of the latest fault's last words, in bytes      | recorder   |
//! | 8084h–80DFh   | these words, UTF-8                                     | recorder   |
//! | 80E0h         | how many starts ago that was; 0 for never              | recorder   |
//! | 80F0h–80F7h   | mark of the bench's file                               | bench      |
//! | 9000h–97FFh   | configuration memory, see `configuration`              | recorder   |
//!
//! Words have 32 bits, little-endian.
//!
//! - Causes: 0 unknown, 1 panic, 2 hard fault, 3 watchdog, 4 stack overflow, 5 the program asked
//!   for it, 6 power.
//! - Faults that can be forced: 1 hard fault, 2 the main loop hangs, 3 panic, 4 stack overflow, 5
//!   capture stops, 6 stack overflow by a store, 7 reset without last words. The recorder clears
//!   the word before it obeys.
//! - Two words with a seal are valid when the seal is the inverse of (low xor (high rotated by 16
//!   bits)).
//!
//! # Design
//! Straps are read once, at boot. After each sample the recorder writes first the tick of the
//! sample and then its inputs. A bench that changes the latch and then finds the change at 8020h
//! therefore knows that it has been sampled, at the latest at the tick that stands at 8004h. This
//! does what a trigger output does for a scope. Before a boot is counted, both words are set to
//! values that no sample can have written, so that the previous run is not taken for this one. The
//! resets of the GENI board are counted because the bench only looks now and then, while a real
//! GENI board misses no pulse.
//!
//! # Tradeoffs
//! Everything is on one bus, so one file on the desktop holds all there is to see and to set.
//!
//! # Notes
//! QEMU backs the bus with a file. What one side writes, the other sees at once. The file outlives
//! the emulator, and so do the configuration and the clock. On the real board the memory there is a
//! PSRAM.

use core::ptr::{self, NonNull};

use geni_board::WindowRam;
use ser_board::genius;
use ser_board::last_words::{Boot, MAX_TEXT_LEN, Text};
use ser_node::Debounce;
use ser_proto::{Model, RecorderId};

use crate::device::base;
use crate::mmio::Word;

/// # Safety
/// `offset` is a multiple of four and less than 16 MiB.
const unsafe fn word(offset: usize) -> Word {
    // SAFETY: AN385 has 16 MiB of memory there; memory.x does not hand it to the linker.
    unsafe { Word::at(base::EXTERNAL_BUS + offset) }
}

// SAFETY: see the map.
const INPUT_LATCH: Word = unsafe { word(0x8000) };
// SAFETY: see the map.
const SAMPLE_COUNTER: Word = unsafe { word(0x8004) };
// SAFETY: see the map.
const MODEL_STRAP: Word = unsafe { word(0x8008) };
// SAFETY: see the map.
const DEBOUNCE_STRAP: Word = unsafe { word(0x800C) };
// SAFETY: see the map.
const BOOT_COUNT: Word = unsafe { word(0x8010) };
// SAFETY: see the map.
const STACK_BYTES: Word = unsafe { word(0x8014) };
// SAFETY: see the map.
const RESET_CAUSE: Word = unsafe { word(0x8018) };
// SAFETY: see the map.
const GENI_RESET: Word = unsafe { word(0x801C) };
// SAFETY: see the map.
const SAMPLED_INPUTS: Word = unsafe { word(0x8020) };
// SAFETY: see the map.
const GENI_STRAP: Word = unsafe { word(0x8024) };
// SAFETY: see the map.
const LAMPS: Word = unsafe { word(0x8028) };
// SAFETY: see the map.
const FORCED_FAULT: Word = unsafe { word(0x802C) };
// SAFETY: see the map.
pub(crate) const CLOCK_COUNT_MS: SealedWords = unsafe { SealedWords::at(0x8030) };
// SAFETY: see the map.
const BOOT_TIME_US: Word = unsafe { word(0x803C) };
// SAFETY: see the map.
pub(crate) const CLOCK_OFFSET_MS: SealedWords = unsafe { SealedWords::at(0x8040) };
// SAFETY: see the map.
const RECORDER_ID: [Word; 3] =
    [unsafe { word(0x8050) }, unsafe { word(0x8054) }, unsafe { word(0x8058) }];
// SAFETY: see the map.
const LAST_WORDS_LEN: Word = unsafe { word(0x8080) };

// SAFETY: see the map.
const LAST_WORDS_AGE: Word = unsafe { word(0x80E0) };

const LAST_WORDS: usize = 0x8084;
const _: () = assert!(MAX_TEXT_LEN == 0x80E0 - LAST_WORDS);

const GENI_WINDOW: usize = 0x0000;
const CONFIGURATION_MEMORY: usize = 0x9000;
/// Bytes of configuration memory.
pub(crate) const CONFIGURATION_LEN: usize = 0x800;
const WORD_LEN: usize = size_of::<u32>();

/// All field inputs, at once.
#[inline]
pub(crate) fn read_inputs() -> u32 {
    INPUT_LATCH.read()
}

/// Tells the bench that the sample of `tick_ms` has been taken, and its inputs. The order of the
/// writes is a promise: see the design.
#[inline]
pub(crate) fn mark_sample(tick_ms: u32, inputs: u32) {
    SAMPLE_COUNTER.write(tick_ms);
    SAMPLED_INPUTS.write(inputs);
}

/// The model that the board is strapped for.
pub(crate) fn model() -> Model {
    match MODEL_STRAP.read() {
        160 => Model::Ser160,
        _ => Model::Ser320,
    }
}

/// Debounce time that the board is strapped for.
pub(crate) fn debounce() -> Debounce {
    let [time_ms, ..] = DEBOUNCE_STRAP.read().to_le_bytes();
    Debounce::uniform(time_ms)
}

/// The number of the recorder.
pub(crate) fn id() -> Option<RecorderId> {
    let mut bytes = [0; RecorderId::LEN];
    for (bytes, word) in bytes.as_chunks_mut().0.iter_mut().zip(&RECORDER_ID) {
        *bytes = word.read().to_le_bytes();
    }
    RecorderId::new(bytes)
}

/// The node's Genius port with its board.
pub(crate) type Genius = genius::Genius<WindowRam, GeniBoard>;

/// A GENI board that is fitted: its shared RAM and its reset line.
pub(crate) struct GeniBoard {
    reset_held: bool,
}

impl GeniBoard {
    /// The board, if the strap says that there is one.
    ///
    /// # Safety
    /// This is called once only: the window belongs to whoever has it.
    pub(crate) unsafe fn find() -> Option<(GeniBoard, WindowRam)> {
        if GENI_STRAP.read() == 0 {
            return None;
        }
        let window =
            NonNull::new(ptr::with_exposed_provenance_mut(base::EXTERNAL_BUS + GENI_WINDOW))?;
        // SAFETY: see the map; nothing else here reaches the window, and the caller has it once
        // only.
        let window = unsafe { WindowRam::new(window) };
        // A run before this one may have ended while it held the line.
        let board = GeniBoard { reset_held: GENI_RESET.read() & 1 != 0 };
        Some((board, window))
    }
}

impl genius::GeniBoard for GeniBoard {
    /// The bus is shared memory: it has no line.
    fn next_pulse(&mut self) -> Option<u32> {
        None
    }

    fn drive_reset(&mut self, held: bool) {
        if held != self.reset_held {
            self.reset_held = held;
            // Bit 0 is the line; adding one to a line that is held carries into the count.
            GENI_RESET.write(GENI_RESET.read().wrapping_add(1));
        }
    }
}

/// Lights lamps and puts them out. Only one context may.
pub(crate) fn change_lamps(change: impl FnOnce(u32) -> u32) {
    LAMPS.write(change(LAMPS.read()));
}

/// The fault that the bench requests, 0 for none. Each request counts once.
#[inline]
pub(crate) fn take_forced_fault() -> u32 {
    let number = FORCED_FAULT.read();
    if number != 0 {
        FORCED_FAULT.write(0);
    }
    number
}

/// Shows the most bytes of the stack that have been in use.
pub(crate) fn mark_stack(bytes: usize) {
    STACK_BYTES.write(u32::try_from(bytes).unwrap_or(u32::MAX));
}

/// Shows how long the boot has taken.
pub(crate) fn mark_boot_time(microseconds: u32) {
    BOOT_TIME_US.write(microseconds);
}

/// Counts a boot and publishes what the latest fault reported. Returns the count.
pub(crate) fn mark_boot(boot: &Boot) -> u32 {
    SAMPLE_COUNTER.write(0);
    SAMPLED_INPUTS.write(!INPUT_LATCH.read());
    STACK_BYTES.write(0);
    RESET_CAUSE.write(boot.cause.code().into());
    let (text, starts_ago) =
        boot.last_words.as_ref().map_or((&Text::EMPTY, 0), |words| (&words.text, words.starts_ago));
    LAST_WORDS_AGE.write(starts_ago);
    let bytes = text.as_str().as_bytes();
    LAST_WORDS_LEN.write(u32::try_from(bytes.len()).unwrap_or(0));
    for (offset, bytes) in (LAST_WORDS..).step_by(WORD_LEN).zip(bytes.chunks(WORD_LEN)) {
        let mut whole = [0; WORD_LEN];
        for (place, &byte) in whole.iter_mut().zip(bytes) {
            *place = byte;
        }
        // SAFETY: see the map; a text has no more than `MAX_TEXT_LEN` bytes.
        unsafe { word(offset) }.write(u32::from_le_bytes(whole));
    }
    // Last: whoever sees the new count finds all of it.
    let count = BOOT_COUNT.read().wrapping_add(1);
    BOOT_COUNT.write(count);
    count
}

/// Two words for a large number, and a third that tells whether they belong together.
#[derive(Clone, Copy)]
pub(crate) struct SealedWords {
    low: Word,
    high: Word,
    seal: Word,
}

impl SealedWords {
    /// # Safety
    /// As for [`word`], for this word and the two after it.
    const unsafe fn at(offset: usize) -> SealedWords {
        // SAFETY: promised by the caller.
        #[expect(clippy::multiple_unsafe_ops_per_block, reason = "one reason for all three")]
        unsafe {
            SealedWords {
                low: word(offset),
                high: word(offset + WORD_LEN),
                seal: word(offset + 2 * WORD_LEN),
            }
        }
    }

    /// The number; `None` when the seal is broken.
    pub(crate) fn read(self) -> Option<u64> {
        let (low, high, seal) = (self.low.read(), self.high.read(), self.seal.read());
        (seal == seal_of(low, high)).then_some(u64::from(high) << 32 | u64::from(low))
    }

    /// Writes a number that has no valid seal yet.
    pub(crate) fn write_unsealed(self, number: u64) {
        let [a, b, c, d, e, f, g, h] = number.to_le_bytes();
        let (low, high) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
        // Invalid for the old number and for the new one.
        self.seal.write(!seal_of(low, high));
        self.low.write(low);
        self.high.write(high);
    }

    /// Seals what was written.
    pub(crate) fn seal(self) {
        self.seal.write(seal_of(self.low.read(), self.high.read()));
    }
}

/// A single changed word always invalidates it, and so do zeros.
const fn seal_of(low: u32, high: u32) -> u32 {
    !(low ^ high.rotate_left(16))
}

/// The words of configuration memory from `offset` on, which is rounded down to a word.
pub(crate) fn configuration(offset: u32) -> impl Iterator<Item = Word> {
    let words = (0..CONFIGURATION_LEN).step_by(WORD_LEN).skip(offset as usize / WORD_LEN);
    // SAFETY: see the map; the memory begins at a multiple of four.
    words.map(|offset| unsafe { word(CONFIGURATION_MEMORY + offset) })
}
