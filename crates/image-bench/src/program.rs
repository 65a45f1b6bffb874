//! What the image's instructions are, as far as timing is concerned: where handlers begin, what
//! calls and returns, what masks interrupts, where the main loop sleeps.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use object::{File, Object, ObjectSection, ObjectSymbol, SectionKind, SymbolKind};

use super::masking::Masking;

/// The entry of the vector table, in words, that has the first instruction after a reset.
const RESET_VECTOR: usize = 1;
/// The first of the chip's own interrupts.
const FIRST_INTERRUPT: usize = 16;
/// Numbers of the interrupts in use, as the firmware's `device` module has them.
const UART0_RX: usize = FIRST_INTERRUPT;
const UART0_TX: usize = FIRST_INTERRUPT + 1;
const TIMER0: usize = FIRST_INTERRUPT + 8;

/// An interrupt handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handler {
    /// A sample of all inputs.
    Capture,
    /// A byte has arrived.
    Receive,
    /// The transmitter has room.
    Transmit,
}

impl Handler {
    /// All handlers.
    pub const ALL: [Handler; 3] = [Handler::Capture, Handler::Receive, Handler::Transmit];
}

/// What an instruction does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Nothing of interest.
    #[default]
    Plain,
    /// It is the first one of a handler.
    Entry(Handler),
    /// It calls.
    Call,
    /// It returns, from a function or from a handler.
    Return,
    /// It masks all interrupts.
    Mask,
    /// It unmasks them.
    Unmask,
    /// It waits for an interrupt.
    Sleep,
}

/// The program of an image.
#[derive(Debug, Default)]
pub struct Program {
    /// Indexed by half the address.
    kinds: Vec<Kind>,
    /// Whether the instruction has four bytes. Indexed in the same way.
    wide: Vec<bool>,
    functions: BTreeMap<u32, (u32, String)>,
    masking: Masking,
    reset: u32,
}

impl Program {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// When it is not what an image has to be, or may mask interrupts in a way that a trace of
    /// addresses does not show.
    pub fn read(path: &Path) -> Result<Program, String> {
        let fails = |what: &dyn std::fmt::Display| format!("{}: {what}", path.display());
        let bytes = fs::read(path).map_err(|error| fails(&error))?;
        let file = File::parse(bytes.as_slice()).map_err(|error| fails(&error))?;
        Program::of(&file).map_err(|what| fails(&what))
    }

    fn of(file: &File<'_>) -> Result<Program, String> {
        let mut program = Program::default();
        let mut marks = BTreeMap::new();
        for symbol in file.symbols() {
            let (Ok(name), address) = (symbol.name(), narrow(symbol.address())) else { continue };
            if symbol.kind() == SymbolKind::Text {
                let end = (address & !1) + narrow(symbol.size());
                let name = format!("{:#}", rustc_demangle::demangle(name));
                program.functions.insert(address & !1, (end, name));
            } else if name.starts_with("$t") || name.starts_with("$d") {
                // Mapping symbols mark where code and data begin.
                marks.insert(address, name.starts_with("$t"));
            }
        }
        for section in file.sections().filter(|section| section.kind() == SectionKind::Text) {
            let begin = narrow(section.address());
            let code = section.data().map_err(|error| error.to_string())?;
            let end = begin + narrow(code.len() as u64);
            let begins: Vec<(u32, bool)> =
                marks.range(begin..end).map(|(&at, &code)| (at, code)).collect();
            for (index, &(from, is_code)) in begins.iter().enumerate() {
                let to = begins.get(index + 1).map_or(end, |&(at, _)| at);
                if is_code {
                    program.add_code(from, &code[index_of(from - begin)..index_of(to - begin)]);
                }
            }
        }
        program.add_vectors(file)?;
        match program.masking.unseen(|address| program.function_around(address)) {
            None => Ok(program),
            Some(at) => Err(format!(
                "the instruction at {at:#x} in {} may mask interrupts, by a value that is not \
                 seen here",
                program.name(at)
            )),
        }
    }

    fn add_vectors(&mut self, file: &File<'_>) -> Result<(), String> {
        let table = file.section_by_name(".vector_table").ok_or("there is no vector table")?;
        let table = table.data().map_err(|error| error.to_string())?;
        let (words, _) = table.as_chunks::<4>();
        let vector = |index: usize| {
            let word = words.get(index).ok_or("the vector table is too short");
            word.map(|&bytes| u32::from_le_bytes(bytes) & !1)
        };
        self.reset = vector(RESET_VECTOR)?;
        for (handler, index) in Handler::ALL.into_iter().zip([TIMER0, UART0_RX, UART0_TX]) {
            self.set(vector(index)?, Kind::Entry(handler));
        }
        Ok(())
    }

    /// Adds a row of instructions.
    fn add_code(&mut self, begin: u32, code: &[u8]) {
        let (halfwords, _) = code.as_chunks::<2>();
        let mut halfwords = halfwords.iter().map(|&bytes| u16::from_le_bytes(bytes));
        let (mut address, mut before) = (begin, 0);
        while let Some(first) = halfwords.next() {
            // ARMv7-M Architecture Reference Manual, A5.1.
            let wide = first >> 11 >= 0b11101;
            let second = if wide { halfwords.next() } else { None };
            self.set(address, kind(first, second));
            self.masking.note(address, before, first, second);
            before = if wide { 0 } else { first };
            self.wide[index_of(address / 2)] = wide;
            address += if wide { 4 } else { 2 };
        }
    }

    fn set(&mut self, address: u32, kind: Kind) {
        let index = index_of(address / 2);
        if index >= self.kinds.len() {
            self.kinds.resize(index + 1, Kind::Plain);
            self.wide.resize(index + 1, false);
        }
        self.kinds[index] = kind;
    }

    /// What the instruction at an address does.
    #[must_use]
    pub fn kind(&self, address: u32) -> Kind {
        self.kinds.get(index_of(address / 2)).copied().unwrap_or_default()
    }

    /// The address of the instruction after the one at an address.
    #[must_use]
    pub fn behind(&self, address: u32) -> u32 {
        let wide = self.wide.get(index_of(address / 2)).copied().unwrap_or_default();
        address + if wide { 4 } else { 2 }
    }

    /// Addresses of the instructions that do this.
    pub fn all(&self, kind: Kind) -> impl Iterator<Item = u32> {
        (0..)
            .step_by(2)
            .zip(&self.kinds)
            .filter(move |(_, of)| **of == kind)
            .map(|(address, _)| address)
    }

    /// The first instruction after a reset.
    #[must_use]
    pub fn reset(&self) -> u32 {
        self.reset
    }

    /// The first instruction of a handler.
    #[must_use]
    pub fn entry(&self, handler: Handler) -> u32 {
        self.all(Kind::Entry(handler)).next().unwrap_or_default()
    }

    /// The instructions with which a handler ends.
    pub fn returns(&self, handler: Handler) -> impl Iterator<Item = u32> {
        let function = self.function_around(self.entry(handler));
        self.all(Kind::Return).filter(move |address| function.contains(address))
    }

    /// The bounds of the function around an address.
    #[must_use]
    pub fn function_around(&self, address: u32) -> Range<u32> {
        let function = self.functions.range(..=address).next_back();
        function.map_or(address..address, |(&begin, &(end, _))| begin..end)
    }

    /// Name of the function around an address.
    #[must_use]
    pub fn name(&self, address: u32) -> &str {
        self.functions.range(..=address).next_back().map_or("?", |(_, (_, name))| name)
    }
}

/// What an instruction does (ARMv7-M Architecture Reference Manual, A7.7).
fn kind(first: u16, second: Option<u16>) -> Kind {
    match (first, second) {
        // BX LR; POP {…, PC}; LDR PC, [SP], #4.
        (0x4770 | 0xBD00..=0xBDFF, None) | (0xF85D, Some(0xFB04)) => Kind::Return,
        // LDMIA SP!, {…, PC}.
        (0xE8BD, Some(registers)) if registers & 1 << 15 != 0 => Kind::Return,
        // BLX Rm.
        (first, None) if first & 0xFF87 == 0x4780 => Kind::Call,
        // BL.
        (0xF000..=0xF7FF, Some(second)) if second & 0xD000 == 0xD000 => Kind::Call,
        // CPSID I, F, or both.
        (0xB671..=0xB673, None) => Kind::Mask,
        // CPSIE; MSR PRIMASK, Rn. `Masking` makes sure that the latter restores what was in force.
        (0xB661..=0xB663, None) | (0xF380..=0xF38F, Some(0x8810)) => Kind::Unmask,
        // WFI.
        (0xBF30, None) => Kind::Sleep,
        _ => Kind::Plain,
    }
}

fn narrow(value: u64) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

fn index_of(offset: u32) -> usize {
    usize::try_from(offset).unwrap_or(usize::MAX)
}

#[cfg(test)]
impl Program {
    /// Code at an address, and handlers there.
    pub(super) fn of_code(begin: u32, code: &[u16], handlers: &[(Handler, u32)]) -> Program {
        let mut program = Program::default();
        let bytes: Vec<u8> = code.iter().flat_map(|halfword| halfword.to_le_bytes()).collect();
        program.add_code(begin, &bytes);
        for &(handler, address) in handlers {
            program.set(address, Kind::Entry(handler));
        }
        program
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_are_told_apart_and_data_inside_of_wide_ones_is_none() {
        // PUSH {LR}; BL; MOVW R0, … with a second half like WFI; CPSID I; CPSIE I; WFI; POP {PC}.
        let code = [0xB500, 0xF000, 0xF801, 0xF640, 0xBF30, 0xB672, 0xB662, 0xBF30, 0xBD00];
        let program = Program::of_code(0x100, &code, &[]);
        let kinds: Vec<Kind> =
            [0x100, 0x102, 0x106, 0x10A, 0x10C, 0x10E, 0x110].map(|at| program.kind(at)).into();
        let expected = [
            Kind::Plain,
            Kind::Call,
            Kind::Plain,
            Kind::Mask,
            Kind::Unmask,
            Kind::Sleep,
            Kind::Return,
        ];
        assert_eq!(kinds, expected);
        assert_eq!(program.all(Kind::Sleep).collect::<Vec<_>>(), [0x10E]);
        assert_eq!((program.behind(0x100), program.behind(0x102)), (0x102, 0x106));
    }

    #[test]
    fn branches_without_a_link_are_no_calls() {
        // B.W backwards, and a conditional one.
        assert_eq!([kind(0xF7FD, Some(0xBA91)), kind(0xF47D, Some(0xAA95))], [Kind::Plain; 2]);
        assert_eq!(kind(0x4798, None), Kind::Call);
        assert_eq!(kind(0xE8BD, Some(0x83F0)), Kind::Return);
        assert_eq!(kind(0xE8BD, Some(0x03F0)), Kind::Plain);
    }

    #[test]
    fn faults_are_masked_along_with_interrupts() {
        assert_eq!([0xB671, 0xB672, 0xB673].map(|first| kind(first, None)), [Kind::Mask; 3]);
        assert_eq!([0xB661, 0xB662, 0xB663].map(|first| kind(first, None)), [Kind::Unmask; 3]);
    }
}
