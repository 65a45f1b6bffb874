//! What can be seen of the emulated board from outside, and done to it: the words of its external
//! bus that are there for the bench.

use std::fmt;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use ser_board::last_words::ResetCause;
use ser_board::leds::Lamps;

use crate::qemu::external_bus::ExternalBus;

/// How often the board is checked while somebody waits for it.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// A fault that the image brings upon itself when told to, to show how it copes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ForcedFault {
    /// It reads an address where there is nothing.
    HardFault = 1,
    /// Its main loop goes no further.
    MainLoopHangs = 2,
    /// It panics.
    Panic = 3,
    /// It calls itself until the stack has run out.
    StackOverflow = 4,
    /// Its capture interrupt stops coming.
    CaptureStops = 5,
    /// Its main program stores something below the stack, and the processor still finds room there
    /// to save registers.
    StackOverflowByStore = 6,
    /// It resets without a word about it.
    SilentReset = 7,
}

/// The emulated board; clones are the same board.
#[derive(Clone)]
pub struct EmulatedBoard {
    bus: Arc<ExternalBus>,
}

impl EmulatedBoard {
    pub(crate) fn new(bus: Arc<ExternalBus>) -> EmulatedBoard {
        EmulatedBoard { bus }
    }

    /// Makes something go wrong in the next pass of the main loop.
    pub fn force(&self, fault: ForcedFault) {
        self.bus.force(fault as u32);
    }

    /// How often the image has started since its memory file was made.
    #[must_use]
    pub fn boots(&self) -> u32 {
        self.bus.boots()
    }

    /// Waits until `seen` is true of the board. False when it takes longer than `timeout`.
    #[must_use]
    pub fn wait(&self, timeout: Duration, mut seen: impl FnMut(&EmulatedBoard) -> bool) -> bool {
        let deadline = Instant::now() + timeout;
        while !seen(self) {
            if Instant::now() > deadline {
                return false;
            }
            thread::sleep(LOOK_EVERY);
        }
        true
    }

    /// Waits until the image has started more than `boots` times and samples its contacts. False
    /// when it takes longer than `timeout`.
    #[must_use]
    pub fn wait_reboot(&self, boots: u32, timeout: Duration) -> bool {
        self.wait(timeout, |board| board.boots() != boots && board.bus.is_sampled())
    }

    /// Why the image last started; `None` when its number has no meaning.
    #[must_use]
    pub fn reset_cause(&self) -> Option<ResetCause> {
        self.bus.reset_cause().try_into().ok().and_then(ResetCause::from_code)
    }

    /// What its latest fault said. Empty when it said nothing, or there was no fault.
    #[must_use]
    pub fn last_words(&self) -> String {
        String::from_utf8_lossy(&self.bus.last_words()).into_owned()
    }

    /// How many starts ago its latest fault was: 1 when its last start was the first one after it.
    /// `None` when there was no fault since it had no power.
    #[must_use]
    pub fn fault_starts_ago(&self) -> Option<NonZeroU32> {
        NonZeroU32::new(self.bus.last_words_age())
    }

    /// Which of its lamps are lit.
    #[must_use]
    pub fn lamps(&self) -> Lamps {
        let lit = |bit: u32| self.bus.lamps() >> bit & 1 != 0;
        Lamps { run: lit(0), event: lit(1), communication: lit(2), fault: lit(3) }
    }

    /// The tick of its latest sample: milliseconds since its last start, wrapping.
    #[must_use]
    pub fn tick_ms(&self) -> u32 {
        self.bus.sample_counter()
    }

    /// How long its last start took by its own timer, from reset until contacts are sampled.
    #[must_use]
    pub fn boot_time(&self) -> Duration {
        Duration::from_micros(self.bus.boot_time_us().into())
    }

    /// The most bytes of its stack in use since its last start. The board checks once a second.
    #[must_use]
    pub fn stack_bytes(&self) -> u32 {
        self.bus.stack_bytes()
    }

    /// The longest time for which the battery-backed clock has stood still because this computer
    /// was busy. The clock then jumps to where it should be. A host that set or read it meanwhile
    /// is late by as much.
    #[must_use]
    pub fn clock_stood_still(&self) -> Duration {
        Duration::from_millis(self.bus.clock_gap_ms())
    }
}

impl fmt::Debug for EmulatedBoard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EmulatedBoard").field("boots", &self.boots()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A board whose own side is played by the test.
    fn board(words: &[(usize, u32)]) -> EmulatedBoard {
        let folder = tempfile::tempdir().unwrap();
        let bus = ExternalBus::open(&folder.path().join("memory")).unwrap();
        for &(offset, value) in words {
            bus.write(offset, value);
        }
        EmulatedBoard::new(Arc::new(bus))
    }

    #[test]
    fn last_words_are_read_as_the_board_lays_them_out() {
        let text = [(0x8080, 5), (0x8084, u32::from_le_bytes(*b"pani")), (0x8088, 0x63)];
        let words = [&[(0x8018, 1), (0x80E0, 3)], &text[..]].concat();
        let panicked = board(&words);
        assert_eq!(panicked.reset_cause(), Some(ResetCause::Panic));
        assert_eq!(panicked.last_words(), "panic");
        assert_eq!(panicked.fault_starts_ago(), NonZeroU32::new(3));
        // Whatever length is given, no more is taken than there is room for.
        let garbled = board(&[(0x8018, 0x0001_0001), (0x8080, u32::MAX)]);
        assert_eq!((garbled.reset_cause(), garbled.last_words().len()), (None, 92));
    }

    #[test]
    fn lamps_are_bits_in_the_order_of_their_names() {
        let lamps = board(&[(0x8028, 0b1010)]).lamps();
        assert_eq!(lamps, Lamps { event: true, fault: true, ..Lamps::default() });
    }

    #[test]
    fn a_reboot_is_over_when_contacts_are_sampled_again() {
        let rebooting = board(&[(0x8010, 8), (0x8004, 0), (0x8020, u32::MAX)]);
        assert!(!rebooting.wait_reboot(7, Duration::ZERO));
        rebooting.bus.write(0x8004, 3);
        rebooting.bus.write(0x8020, 0);
        assert!(rebooting.wait_reboot(7, Duration::ZERO));
        assert!(!rebooting.wait_reboot(8, Duration::ZERO));
    }
}
