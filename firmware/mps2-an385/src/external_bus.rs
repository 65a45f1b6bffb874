//! The external bus: GENI board, field inputs, straps, marks for the bench, configuration memory.
//!
//! | offset        | what                                                   | written by |
//! |---------------|--------------------------------------------------------|------------|
//! | 0000h–3FFFh   | shared RAM window of the GENI board                    | both       |
//! | 8000h         | input latch, input 1 in bit 0                          | bench      |
//! | 8004h         | sample counter: tick of the latest sample, in ms       | recorder   |
//! | 8008h         | model strap: 160 for SER160, anything else is SER320   | bench      |
//! | 800Ch         | debounce strap: ms for every input, 0–255, low byte    | bench      |
//! | 8010h         | boot count                                             | recorder   |
//! | 8014h         | fault mark: why the recorder is about to reset itself  | recorder   |
//! | 8018h         | the fault mark that the latest boot found              | recorder   |
//! | 801Ch         | reset line of the GENI board: bit 0 is set as long as  | recorder   |
//! |               | it is held; the bits above count how often it was held |            |
//! | 8020h         | the inputs as the latest sample saw them               | recorder   |
//! | 8024h         | GENI strap: 0 for no board, anything else for a board  | bench      |
//! | 9000h, 9040h  | configuration memory, two blocks of 64 bytes           | recorder   |
//!
//! Words have 32 bits, little-endian. Fault marks: 0 none, 1 panic, 2 hard fault, 3 watchdog, 4 stack
//! overflow.
//!
//! # Design
//! Straps are read once, at boot. After each sample the recorder writes first its tick and then what it saw: whoever
//! changes the latch and then finds the change at 8020h knows that it has been sampled, and not later than at the tick
//! that stands at 8004h. It is what a trigger output is to a scope. The reset line is counted because the bench looks at
//! it now and then, and a GENI board misses no pulse. Configuration memory stands for an FRAM: it needs no erasing, and the
//! two blocks never share a write.
//!
//! # Tradeoffs
//! Everything sits on one bus, so one file on the desktop holds all there is to see and to set.
//!
//! # Notes
//! QEMU backs the bus with a file; what is written on either side is seen on the other at once. The file outlives
//! the emulator, and so does the configuration. On the real board the memory there is a PSRAM.

use core::convert::Infallible;
use core::ptr::{self, NonNull};

use geni::WindowRam;
use ser_node::{CopyNumber, Debounce, RECORD_LEN, Storage};
use ser_proto::Model;

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
const FAULT_MARK: Word = unsafe { word(0x8014) };
// SAFETY: see the map.
const FAULT_FOUND: Word = unsafe { word(0x8018) };
// SAFETY: see the map.
const GENI_RESET: Word = unsafe { word(0x801C) };
// SAFETY: see the map.
const SAMPLED_INPUTS: Word = unsafe { word(0x8020) };

// SAFETY: see the map.
const GENI_STRAP: Word = unsafe { word(0x8024) };

const GENI_WINDOW: usize = 0x0000;
const CONFIGURATION_MEMORY: usize = 0x9000;
const COPY_DISTANCE: usize = 0x40;
const WORD_LEN: usize = size_of::<u32>();
const _: () = assert!(RECORD_LEN <= COPY_DISTANCE && RECORD_LEN.is_multiple_of(WORD_LEN));

/// All field inputs, at once.
#[inline]
pub(crate) fn read_inputs() -> u32 {
    INPUT_LATCH.read()
}

/// Tells the bench that the sample of `tick_ms` has been taken, and what it was. The order is a promise: see the design.
#[inline]
pub(crate) fn mark_sample(tick_ms: u32, inputs: u32) {
    SAMPLE_COUNTER.write(tick_ms);
    SAMPLED_INPUTS.write(inputs);
}

/// Which recorder the board is strapped to be.
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
        let window = NonNull::new(ptr::with_exposed_provenance_mut(base::EXTERNAL_BUS + GENI_WINDOW))?;
        // SAFETY: see the map; nothing else here reaches the window, and the caller has it once only.
        let window = unsafe { WindowRam::new(window) };
        // A run before this one may have ended while it held the line.
        let board = GeniBoard { reset_held: GENI_RESET.read() & 1 != 0 };
        Some((board, window))
    }

    /// Drives the reset line.
    pub(crate) fn drive_reset(&mut self, held: bool) {
        if held != self.reset_held {
            self.reset_held = held;
            // Bit 0 is the line; adding one to a line that is held carries into the count.
            GENI_RESET.write(GENI_RESET.read().wrapping_add(1));
        }
    }
}

/// Why the recorder resets itself.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum Fault {
    Panic = 1,
    Exception = 2,
    Watchdog = 3,
    StackOverflow = 4,
}

/// The words for a fault mark; `None` when there is none.
pub(crate) fn fault_name(mark: u32) -> Option<&'static str> {
    Some(match mark {
        0 => return None,
        1 => "panic",
        2 => "hard fault",
        3 => "watchdog",
        4 => "stack overflow",
        _ => "unknown fault mark",
    })
}

/// What was found at boot.
#[derive(Clone, Copy)]
pub(crate) struct Boot {
    /// How often the recorder has booted, this time included.
    pub(crate) count: u32,
    /// The fault mark of the run before; 0 after power-up and after a reset from outside.
    pub(crate) fault: u32,
}

/// Counts the boot and moves the fault mark to where the bench can see it.
pub(crate) fn boot() -> Boot {
    let count = BOOT_COUNT.read().wrapping_add(1);
    BOOT_COUNT.write(count);
    let fault = FAULT_MARK.read();
    FAULT_FOUND.write(fault);
    FAULT_MARK.write(0);
    Boot { count, fault }
}

/// Leaves a mark for the next boot.
#[inline]
pub(crate) fn mark_fault(fault: Fault) {
    FAULT_MARK.write(fault as u32);
}

/// Takes the mark back: it did not come to a reset.
pub(crate) fn unmark_fault() {
    FAULT_MARK.write(0);
}

/// The two blocks of configuration memory.
pub(crate) struct ConfigurationMemory;

fn words(copy: CopyNumber) -> impl Iterator<Item = Word> {
    let block = match copy {
        CopyNumber::First => CONFIGURATION_MEMORY,
        CopyNumber::Second => CONFIGURATION_MEMORY + COPY_DISTANCE,
    };
    // SAFETY: see the map; the blocks begin at a multiple of four.
    (block..block + RECORD_LEN).step_by(WORD_LEN).map(|offset| unsafe { word(offset) })
}

impl Storage for ConfigurationMemory {
    type Error = Infallible;

    fn read(&mut self, copy: CopyNumber, record: &mut [u8; RECORD_LEN]) -> Result<(), Infallible> {
        for (word, bytes) in words(copy).zip(record.as_chunks_mut::<WORD_LEN>().0) {
            *bytes = word.read().to_le_bytes();
        }
        Ok(())
    }

    fn write(&mut self, copy: CopyNumber, record: &[u8; RECORD_LEN]) -> Result<(), Infallible> {
        for (word, bytes) in words(copy).zip(record.as_chunks::<WORD_LEN>().0) {
            word.write(u32::from_le_bytes(*bytes));
        }
        Ok(())
    }
}
