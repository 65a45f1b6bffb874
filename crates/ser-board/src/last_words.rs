//! What a recorder keeps across resets: why it was reset, what the latest fault reported, and how
//! often it has started.
//!
//! It lives in memory that start-up code leaves alone. After a power cut such memory holds
//! anything, so nothing in it is believed without its check. After any other reset it holds what
//! was written.
//!
//! ```text
//! word  0        1       2       3       4       5       6–28           29
//!     | "SERb" | boots | check | "SERw" | cause, | boot | text, UTF-8, | check |
//!     |        |       | of 0–1|        | length | no.  | zeros behind | of 3–28 |
//! ```
//!
//! # Design
//! There are two records, each with its own CRC-32. A fault that is cut short while it writes its
//! words costs the words, never the count of boots. A fault's words stay through any number of
//! starts, until the next fault replaces them or the power goes, because whoever comes to see what
//! happened comes late. The record holds the number of the boot in which the fault happened. That
//! number tells whether the fault is why the recorder starts, so the words need not be touched to
//! become old.
//!
//! # Tradeoffs
//! A panic's message is kept as far as it fits into 92 bytes. The board formats it, by [`Text`]'s
//! `fmt::Write`.
//!
//! # Notes
//! The board puts the array into a section that is neither zeroed nor loaded (`.uninit` of
//! cortex-m-rt). It reads the array at start-up and writes it back. The content never has to be a
//! valid value of any type but `u32`.

use core::fmt;
use core::panic::Location;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

/// Length of the memory, in words of 32 bits.
pub const WORDS: usize = BOOT_WORDS + FAULT_WORDS;

/// The longest text that is kept, in bytes.
pub const MAX_TEXT_LEN: usize = TEXT_WORDS * 4;

const TEXT_WORDS: usize = 23;
const BOOT_WORDS: usize = 3;
const FAULT_WORDS: usize = 4 + TEXT_WORDS;

const BOOT_MAGIC: u32 = u32::from_le_bytes(*b"SERb");
const FAULT_MAGIC: u32 = u32::from_le_bytes(*b"SERw");

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The memory itself. Its content after power-up is undefined.
pub type Memory = [u32; WORDS];

/// Why the recorder is about to reset itself. The numbers are those in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Fault {
    /// The program found an impossible state.
    Panic = 1,
    /// The processor found an impossible access or instruction.
    HardFault = 2,
    /// The watchdog is about to reset the chip: the main loop or capture stands still.
    Watchdog = 3,
    /// The stack has overflowed.
    StackOverflow = 4,
}

impl Fault {
    const fn from_code(code: u8) -> Option<Fault> {
        Some(match code {
            1 => Fault::Panic,
            2 => Fault::HardFault,
            3 => Fault::Watchdog,
            4 => Fault::StackOverflow,
            _ => return None,
        })
    }
}

/// The chip's reset flag. Where several are set, the board reports the first of them in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetFlag {
    /// Power came up.
    PowerOn,
    /// The supply voltage dropped.
    BrownOut,
    /// A watchdog.
    Watchdog,
    /// The program requested it.
    Software,
    /// The reset pin, which most chips also pull for all other resets.
    Pin,
    /// The chip does not say.
    Unknown,
}

/// Why the recorder starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// Power came up.
    PowerOn,
    /// The supply voltage dropped.
    BrownOut,
    /// The reset pin.
    Pin,
    /// The program requested it.
    Software,
    /// The watchdog reset the chip.
    Watchdog,
    /// The processor found an impossible access or instruction.
    HardFault,
    /// The program found an impossible state.
    Panic,
    /// The stack had overflowed.
    StackOverflow,
    /// Nothing is known.
    Unknown,
}

impl ResetCause {
    /// Whether the previous run ended in a fault of the recorder.
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(
            self,
            ResetCause::Watchdog
                | ResetCause::HardFault
                | ResetCause::Panic
                | ResetCause::StackOverflow
        )
    }

    /// A number for each cause, for memory that others read. The numbers never change: 0 is
    /// [`Unknown`](Self::Unknown), 1–4 are those of [`Fault`].
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            ResetCause::Unknown => 0,
            ResetCause::Panic => Fault::Panic as u8,
            ResetCause::HardFault => Fault::HardFault as u8,
            ResetCause::Watchdog => Fault::Watchdog as u8,
            ResetCause::StackOverflow => Fault::StackOverflow as u8,
            ResetCause::Software => 5,
            ResetCause::PowerOn => 6,
            ResetCause::BrownOut => 7,
            ResetCause::Pin => 8,
        }
    }

    /// The cause with this number; `None` if there is none.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<ResetCause> {
        Some(match code {
            0 => ResetCause::Unknown,
            1 => ResetCause::Panic,
            2 => ResetCause::HardFault,
            3 => ResetCause::Watchdog,
            4 => ResetCause::StackOverflow,
            5 => ResetCause::Software,
            6 => ResetCause::PowerOn,
            7 => ResetCause::BrownOut,
            8 => ResetCause::Pin,
            _ => return None,
        })
    }

    /// `fault` is that of the previous run. The flags know about the power: what the program wrote
    /// down before a voltage drop is not why it starts now. In all other cases the program knew
    /// better than the flags: a panic ends in a software reset, a locked-up processor in the
    /// watchdog.
    const fn new(flag: ResetFlag, fault: Option<Fault>) -> ResetCause {
        match (flag, fault) {
            (ResetFlag::PowerOn, _) => ResetCause::PowerOn,
            (ResetFlag::BrownOut, _) => ResetCause::BrownOut,
            (_, Some(Fault::Panic)) => ResetCause::Panic,
            (_, Some(Fault::HardFault)) => ResetCause::HardFault,
            (_, Some(Fault::StackOverflow)) => ResetCause::StackOverflow,
            (_, Some(Fault::Watchdog)) | (ResetFlag::Watchdog, _) => ResetCause::Watchdog,
            (ResetFlag::Software, None) => ResetCause::Software,
            (ResetFlag::Pin, None) => ResetCause::Pin,
            (ResetFlag::Unknown, None) => ResetCause::Unknown,
        }
    }
}

/// A text of bounded length. What does not fit is left out; a character is never cut in half.
#[derive(Clone, Copy)]
pub struct Text {
    bytes: [u8; MAX_TEXT_LEN],
    len: usize,
    /// Something was left out, so nothing may be added after it.
    full: bool,
}

impl Text {
    /// No text.
    pub const EMPTY: Text = Text { bytes: [0; MAX_TEXT_LEN], len: 0, full: false };

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..self.len).unwrap_or_default();
        // Always valid, because only whole characters go in. If the memory is corrupt, the valid
        // part is returned.
        match core::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => bytes
                .get(..error.valid_up_to())
                .and_then(|valid| core::str::from_utf8(valid).ok())
                .unwrap_or_default(),
        }
    }

    /// Adds as much of `text` as fits.
    pub fn push_str(&mut self, text: &str) {
        for character in text.chars() {
            let mut utf8 = [0; 4];
            let character = character.encode_utf8(&mut utf8).as_bytes();
            let end = self.len + character.len();
            match self.bytes.get_mut(self.len..end) {
                Some(place) if !self.full => {
                    for (place, &byte) in place.iter_mut().zip(character) {
                        *place = byte;
                    }
                    self.len = end;
                }
                _ => {
                    self.full = true;
                    return;
                }
            }
        }
    }

    /// Adds a number.
    pub fn push_decimal(&mut self, number: u32) {
        let mut unit = 1_000_000_000;
        while unit > 1 && number < unit {
            unit /= 10;
        }
        while unit != 0 {
            self.push_digit(number / unit % 10);
            unit /= 10;
        }
    }

    /// Adds a word in hexadecimal: eight digits.
    pub fn push_hex(&mut self, word: u32) {
        for shift in (0..u32::BITS).step_by(4).rev() {
            self.push_digit(word >> shift & 0xF);
        }
    }

    fn push_digit(&mut self, digit: u32) {
        let digit = char::from_digit(digit, 16).unwrap_or('?');
        self.push_str(digit.encode_utf8(&mut [0; 4]));
    }

    /// The text of a panic: place and message, as in `node.rs:42: no room`.
    ///
    /// A message with arguments would bring in the formatting machinery. Such a panic is reported
    /// by its place alone.
    #[must_use]
    pub fn of_panic(place: Option<&Location<'_>>, message: Option<&str>) -> Text {
        let mut text = Text::EMPTY;
        if let Some(place) = place {
            text.push_str(place.file());
            text.push_str(":");
            text.push_decimal(place.line());
            text.push_str(": ");
        }
        text.push_str(message.unwrap_or("panic"));
        text
    }

    fn from_words(words: &[u32], len: usize) -> Text {
        let mut text = Text { len: len.min(MAX_TEXT_LEN), ..Text::EMPTY };
        for (place, word) in text.bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *place = word.to_le_bytes();
        }
        text
    }
}

/// Compares the texts, whether or not something was left out.
impl PartialEq for Text {
    fn eq(&self, other: &Text) -> bool {
        self.as_str() == other.as_str()
    }
}

impl Eq for Text {}

impl From<&str> for Text {
    fn from(text: &str) -> Text {
        let mut kept = Text::EMPTY;
        kept.push_str(text);
        kept
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Text {
    fn format(&self, f: defmt::Formatter<'_>) {
        self.as_str().format(f);
    }
}

/// Never fails: what does not fit is left out.
impl fmt::Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.push_str(text);
        Ok(())
    }
}

/// What the latest fault reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LastWords {
    /// The kind of fault.
    pub fault: Fault,
    /// The place, and what else is known; may be empty.
    pub text: Text,
    /// How many starts ago: 1 when this is the first start after the fault; never 0.
    pub starts_ago: u32,
}

/// What is known at start-up about earlier runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Boot {
    /// How often the recorder has started since its memory was last lost, including this start.
    pub count: u32,
    /// Why it starts.
    pub cause: ResetCause,
    /// The latest fault since the memory was last lost, whether or not it is why the recorder
    /// starts.
    pub last_words: Option<LastWords>,
}

/// Whether the memory holds what an earlier run of the program left. If it does not, it has been
/// without power. That tells a chip without reset flags why it starts.
#[must_use]
pub fn is_kept(memory: &Memory) -> bool {
    let (boots, _) = memory.split_at(BOOT_WORDS);
    matches!(open(boots), Some([BOOT_MAGIC, _]))
}

/// Reads what earlier runs left, counts the boot, and prepares the memory for this run's last
/// words. The words of an earlier run stay.
pub fn boot(memory: &mut Memory, flag: ResetFlag) -> Boot {
    let (boots, words) = memory.split_at_mut(BOOT_WORDS);
    let before = match open(boots) {
        Some([BOOT_MAGIC, count]) => Some(count),
        _ => None,
    };
    let count = before.map_or(1, |before| before.saturating_add(1));
    let left = read_fault(words);
    if let Some(left) = &left
        && before.is_none()
    {
        // The numbers start anew. The words belong to the run before the first one.
        write_fault(words, left.fault, &left.text, 0);
    }
    seal(boots, [BOOT_MAGIC, count].into_iter());
    let last_words = left.map(|Left { fault, text, boot }| {
        let starts_ago = before.map_or(1, |_| count.saturating_sub(boot).max(1));
        LastWords { fault, text, starts_ago }
    });
    let fault = last_words.filter(|words| words.starts_ago == 1).map(|words| words.fault);
    Boot { count, cause: ResetCause::new(flag, fault), last_words }
}

/// Writes the last words of this run over those of an earlier one.
pub fn write(memory: &mut Memory, fault: Fault, text: &Text) {
    let (boots, words) = memory.split_at_mut(BOOT_WORDS);
    let boot = match open(boots) {
        Some([BOOT_MAGIC, count]) => count,
        _ => 0,
    };
    write_fault(words, fault, text, boot);
}

/// The content of a fault's record.
struct Left {
    fault: Fault,
    text: Text,
    boot: u32,
}

fn read_fault(words: &[u32]) -> Option<Left> {
    let [FAULT_MAGIC, head, boot, text @ ..] = content(words)? else { return None };
    let [code, len, 0, 0] = head.to_le_bytes() else { return None };
    Some(Left {
        fault: Fault::from_code(code)?,
        text: Text::from_words(text, len.into()),
        boot: *boot,
    })
}

fn write_fault(words: &mut [u32], fault: Fault, text: &Text, boot: u32) {
    let [len, ..] = text.len.to_le_bytes();
    let head = u32::from_le_bytes([fault as u8, len, 0, 0]);
    let text = text.bytes.as_chunks::<4>().0.iter().map(|&bytes| u32::from_le_bytes(bytes));
    seal(words, [FAULT_MAGIC, head, boot].into_iter().chain(text));
}

/// The words before the check, if the check is right.
fn content(record: &[u32]) -> Option<&[u32]> {
    let (&check, content) = record.split_last()?;
    (checksum(content) == check).then_some(content)
}

fn open<const N: usize>(record: &[u32]) -> Option<[u32; N]> {
    content(record)?.try_into().ok()
}

/// Fills a record and appends the check.
fn seal(record: &mut [u32], words: impl Iterator<Item = u32>) {
    let Some((check, content)) = record.split_last_mut() else { return };
    for (place, word) in content.iter_mut().zip(words) {
        *place = word;
    }
    *check = checksum(content);
}

fn checksum(words: &[u32]) -> u32 {
    let mut digest = CRC.digest();
    for word in words {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use proptest::prelude::*;

    use super::*;

    /// Memory as the very first power-up finds it.
    fn random() -> Memory {
        let mut noise = oorandom::Rand32::new(0xDEAD_BEEF);
        [(); WORDS].map(|()| noise.rand_u32())
    }

    fn said(fault: Fault, text: &str, starts_ago: u32) -> Option<LastWords> {
        Some(LastWords { fault, text: Text::from(text), starts_ago })
    }

    #[test]
    fn the_first_power_up_counts_one_and_has_nothing_to_tell() {
        for mut memory in [random(), [0; WORDS], [u32::MAX; WORDS]] {
            let first = Boot { count: 1, cause: ResetCause::PowerOn, last_words: None };
            assert_eq!(boot(&mut memory, ResetFlag::PowerOn), first);
            let second = Boot { count: 2, cause: ResetCause::Pin, last_words: None };
            assert_eq!(boot(&mut memory, ResetFlag::Pin), second);
        }
    }

    #[test]
    fn a_panic_is_told_at_each_boot_and_is_the_cause_of_the_next_one_only() {
        let mut memory = random();
        let _ = boot(&mut memory, ResetFlag::PowerOn);
        let mut text = Text::EMPTY;
        let (file, line) = ("node.rs", 42);
        write!(text, "{file}:{line}: no room").unwrap();
        write(&mut memory, Fault::Panic, &text);
        let told = boot(&mut memory, ResetFlag::Software);
        assert_eq!((told.count, told.cause), (2, ResetCause::Panic));
        assert!(told.cause.is_fault());
        assert_eq!(told.last_words, said(Fault::Panic, "node.rs:42: no room", 1));
        for (starts_ago, flag) in
            (2..).zip([ResetFlag::Software, ResetFlag::Pin, ResetFlag::Watchdog])
        {
            let after = boot(&mut memory, flag);
            assert_eq!((after.count, after.cause), (starts_ago + 1, ResetCause::new(flag, None)));
            assert_eq!(after.last_words, said(Fault::Panic, "node.rs:42: no room", starts_ago));
        }
    }

    #[test]
    fn words_stay_until_the_next_fault_has_some() {
        let mut memory = random();
        let _ = boot(&mut memory, ResetFlag::PowerOn);
        write(&mut memory, Fault::Panic, &Text::from("a long text in front of a short one"));
        for _ in 0..1000 {
            let told = boot(&mut memory, ResetFlag::Pin);
            assert_eq!(told.last_words.map(|words| words.fault), Some(Fault::Panic));
        }
        write(&mut memory, Fault::HardFault, &Text::from("pc 0"));
        let told = boot(&mut memory, ResetFlag::Software);
        assert_eq!((told.count, told.cause), (1002, ResetCause::HardFault));
        assert_eq!(told.last_words, said(Fault::HardFault, "pc 0", 1));
    }

    /// Memory that survived a short power cut intact, or one that lost only the count.
    #[test]
    fn words_that_are_whole_are_told_whatever_became_of_the_count_or_the_power() {
        let mut memory = random();
        for _ in 0..7 {
            let _ = boot(&mut memory, ResetFlag::Pin);
        }
        write(&mut memory, Fault::StackOverflow, &Text::from("pc 1"));
        let mut kept = memory;
        let told = boot(&mut kept, ResetFlag::BrownOut);
        assert_eq!((told.count, told.cause), (8, ResetCause::BrownOut));
        assert_eq!(told.last_words, said(Fault::StackOverflow, "pc 1", 1));
        memory[1] ^= 1;
        for starts_ago in 1..4 {
            let told = boot(&mut memory, ResetFlag::Software);
            let cause =
                if starts_ago == 1 { ResetCause::StackOverflow } else { ResetCause::Software };
            assert_eq!((told.count, told.cause), (starts_ago, cause));
            assert_eq!(told.last_words, said(Fault::StackOverflow, "pc 1", starts_ago));
        }
    }

    #[test]
    fn a_fault_before_the_first_boot_is_counted_is_one_of_the_run_before() {
        let mut memory = random();
        write(&mut memory, Fault::HardFault, &Text::from("the crystal"));
        let told = boot(&mut memory, ResetFlag::Software);
        assert_eq!((told.count, told.cause), (1, ResetCause::HardFault));
        assert_eq!(
            boot(&mut memory, ResetFlag::Pin).last_words,
            said(Fault::HardFault, "the crystal", 2)
        );
    }

    #[test]
    fn the_cause_is_what_the_program_knew_unless_the_power_went() {
        let causes = [
            (ResetFlag::Software, Some(Fault::Panic), ResetCause::Panic),
            (ResetFlag::Software, Some(Fault::HardFault), ResetCause::HardFault),
            (ResetFlag::Watchdog, Some(Fault::StackOverflow), ResetCause::StackOverflow),
            (ResetFlag::Watchdog, Some(Fault::Watchdog), ResetCause::Watchdog),
            (ResetFlag::BrownOut, Some(Fault::Panic), ResetCause::BrownOut),
            (ResetFlag::PowerOn, Some(Fault::Panic), ResetCause::PowerOn),
            (ResetFlag::Watchdog, None, ResetCause::Watchdog),
            (ResetFlag::Software, None, ResetCause::Software),
            (ResetFlag::Pin, None, ResetCause::Pin),
            (ResetFlag::Unknown, None, ResetCause::Unknown),
        ];
        for (flag, fault, cause) in causes {
            let mut memory = [0; WORDS];
            if let Some(fault) = fault {
                write(&mut memory, fault, &Text::from("x"));
            }
            assert_eq!(boot(&mut memory, flag).cause, cause, "{flag:?} after {fault:?}");
        }
    }

    #[test]
    fn memory_that_no_run_has_written_is_known_by_it() {
        for mut memory in [random(), [0; WORDS], [u32::MAX; WORDS]] {
            assert!(!is_kept(&memory));
            let _ = boot(&mut memory, ResetFlag::Unknown);
            assert!(is_kept(&memory));
            memory[1] ^= 1;
            assert!(!is_kept(&memory));
        }
    }

    #[test]
    fn every_cause_comes_back_from_its_number() {
        let causes: Vec<_> = (0..=u8::MAX).filter_map(ResetCause::from_code).collect();
        assert_eq!(causes.len(), 9);
        for (code, cause) in (0..).zip(causes) {
            assert_eq!(cause.code(), code);
        }
        let as_causes = (0..=u8::MAX).filter_map(Fault::from_code).map(|fault| {
            let cause = ResetCause::new(ResetFlag::Unknown, Some(fault));
            assert_eq!(cause.code(), fault as u8);
            cause.is_fault()
        });
        assert_eq!(as_causes.collect::<Vec<_>>(), [true; 4]);
    }

    #[test]
    fn numbers_and_places_stand_in_a_text() {
        let mut text = Text::EMPTY;
        for number in [0, 7, 10, 4_294_967_295] {
            text.push_decimal(number);
            text.push_str(" ");
        }
        text.push_hex(0x0A0B_12FF);
        assert_eq!(text.as_str(), "0 7 10 4294967295 0a0b12ff");
        let place = Location::caller();
        let expected = format!("{}:{}: no room", place.file(), place.line());
        assert_eq!(Text::of_panic(Some(place), Some("no room")).as_str(), expected);
        assert_eq!(Text::of_panic(None, None).as_str(), "panic");
    }

    #[test]
    fn a_reset_while_words_are_written_leaves_the_new_ones_or_none_and_the_count() {
        let mut before = random();
        for _ in 0..6 {
            let _ = boot(&mut before, ResetFlag::Pin);
        }
        write(&mut before, Fault::Watchdog, &Text::from("what an earlier run had to say"));
        let _ = boot(&mut before, ResetFlag::Watchdog);
        let mut after = before;
        write(&mut after, Fault::Panic, &Text::from("a text that takes a few words"));
        // The words begin after the boots. If none of them has been written, those of the earlier
        // run stand.
        for cut in BOOT_WORDS + 2..WORDS {
            let mut memory = before;
            memory[..cut].copy_from_slice(&after[..cut]);
            let told = boot(&mut memory, ResetFlag::Software);
            assert_eq!(
                (told.count, told.cause, told.last_words),
                (8, ResetCause::Software, None),
                "cut at {cut}"
            );
        }
        let told = boot(&mut before, ResetFlag::Software);
        assert_eq!(told.last_words, said(Fault::Watchdog, "what an earlier run had to say", 2));
        let told = boot(&mut after, ResetFlag::Software);
        assert_eq!((told.count, told.cause), (8, ResetCause::Panic));
    }

    #[test]
    fn a_long_text_ends_between_two_characters() {
        assert_eq!(Text::from("x".repeat(93).as_str()).as_str(), "x".repeat(92));
        // Two bytes each, so that a cut at an odd place would halve one.
        let text = Text::from(format!("x{}", "é".repeat(50)).as_str());
        assert_eq!(text.as_str(), format!("x{}", "é".repeat(45)));
        // A short character after one that did not fit would be out of place.
        let mut text = Text::from("y".repeat(90).as_str());
        text.push_str("€z");
        text.push_str("z");
        assert_eq!(text.as_str(), "y".repeat(90));
    }

    proptest! {
        #[test]
        fn random_memory_is_never_taken_for_last_words(words: [u32; WORDS]) {
            let mut memory = words;
            let told = boot(&mut memory, ResetFlag::Pin);
            prop_assert_eq!(told, Boot { count: 1, cause: ResetCause::Pin, last_words: None });
        }

        #[test]
        fn a_flipped_bit_is_noticed(bit in 0..WORDS * 32, text in "\\PC{0,40}") {
            let mut memory = [0; WORDS];
            let _ = boot(&mut memory, ResetFlag::PowerOn);
            write(&mut memory, Fault::Panic, &Text::from(text.as_str()));
            memory[bit / 32] ^= 1 << (bit % 32);
            let told = boot(&mut memory, ResetFlag::Software);
            if bit / 32 < BOOT_WORDS {
                prop_assert_eq!((told.count, told.cause), (1, ResetCause::Panic));
                prop_assert_eq!(told.last_words, said(Fault::Panic, &text, 1));
            } else {
                prop_assert_eq!((told.count, told.cause, told.last_words), (2, ResetCause::Software, None));
            }
        }

        #[test]
        fn any_text_comes_back_as_far_as_it_fits(text in "\\PC{0,200}") {
            let mut memory = [u32::MAX; WORDS];
            write(&mut memory, Fault::Panic, &Text::from(text.as_str()));
            let told = boot(&mut memory, ResetFlag::Software).last_words.unwrap().text;
            prop_assert!(text.starts_with(told.as_str()));
            prop_assert!(told.as_str().len() + 3 >= text.len().min(MAX_TEXT_LEN));
        }
    }
}
