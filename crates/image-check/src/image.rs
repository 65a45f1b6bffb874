//! An image as the linker has left it: its bytes, its functions, and which parts are code.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{
    File, Object, ObjectSection, ObjectSymbol, Section, SectionFlags, SectionKind, Symbol,
    SymbolKind,
};

use crate::names;

/// The longest file, with debug information, in bytes.
const MAX_FILE_LEN: u64 = 64 << 20;

/// The most bytes that an image loads: the memory of the largest controllers of this family.
const MAX_LOADED_LEN: u64 = 4 << 20;

/// The most regions of memory that an image loads.
const MAX_PIECES: usize = 256;

/// Why a file cannot be read as an image.
#[derive(Debug)]
pub struct ReadError {
    file: PathBuf,
    why: Why,
}

#[derive(Debug)]
enum Why {
    /// The file cannot be read.
    Unread(io::Error),
    /// It is not an ELF file, or is damaged.
    NoElf(object::Error),
    /// It is too large for any board.
    TooLarge,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        match &self.why {
            Why::Unread(error) => write!(f, "{file}: {error}"),
            Why::NoElf(error) => write!(f, "{file}: {error}"),
            Why::TooLarge => write!(f, "{file}: too large for any board"),
        }
    }
}

impl std::error::Error for ReadError {}

impl From<io::Error> for Why {
    fn from(error: io::Error) -> Why {
        Why::Unread(error)
    }
}

impl From<object::Error> for Why {
    fn from(error: object::Error) -> Why {
        Why::NoElf(error)
    }
}

/// What an image loads into one region of memory.
#[derive(Debug)]
pub(crate) struct Piece {
    pub(crate) name: String,
    pub(crate) address: u32,
    pub(crate) size: u32,
    /// Empty when the region is only reserved.
    pub(crate) bytes: Vec<u8>,
    /// Whether it holds variables.
    pub(crate) writable: bool,
}

impl Piece {
    pub(crate) fn addresses(&self) -> Range<u32> {
        self.address..self.address.saturating_add(self.size)
    }
}

/// A function, from its address to its end.
#[derive(Debug, Default)]
pub(crate) struct Function {
    /// The names as in the source, aliases included.
    pub(crate) names: Vec<String>,
    pub(crate) end: u32,
}

impl Function {
    /// The first of its names.
    pub(crate) fn name(&self) -> &str {
        self.names.first().map_or("?", String::as_str)
    }
}

/// An image.
#[derive(Debug, Default)]
pub(crate) struct Image {
    pub(crate) pieces: Vec<Piece>,
    /// The functions, by address.
    pub(crate) functions: BTreeMap<u32, Function>,
    /// Where code (true) and data (false) begin, in pieces that hold both.
    code_begins: BTreeMap<u32, bool>,
    /// Sizes of variables and constants, by address.
    objects: BTreeMap<u32, u32>,
    /// All other symbols.
    symbols: BTreeMap<String, u32>,
}

impl Image {
    /// Reads an ELF file.
    pub(crate) fn read(file: &Path) -> Result<Image, ReadError> {
        Image::read_elf(file).map_err(|why| ReadError { file: file.to_owned(), why })
    }

    fn read_elf(file: &Path) -> Result<Image, Why> {
        let mut bytes = Vec::new();
        fs::File::open(file)?.take(MAX_FILE_LEN + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > MAX_FILE_LEN {
            return Err(Why::TooLarge);
        }
        let file = File::parse(bytes.as_slice())?;
        let mut image = Image::default();
        let mut loaded: u64 = 0;
        for section in file.sections().filter(|section| is_loaded(section) && section.size() > 0) {
            let reserved = section.kind() == SectionKind::UninitializedData;
            let bytes = if reserved { &[] } else { section.data()? };
            loaded += bytes.len() as u64;
            if loaded > MAX_LOADED_LEN || image.pieces.len() >= MAX_PIECES {
                return Err(Why::TooLarge);
            }
            image.pieces.push(Piece {
                name: section.name()?.to_owned(),
                address: narrow(section.address()),
                size: narrow(section.size()),
                bytes: bytes.to_vec(),
                writable: has_flag(&section, SHF_WRITE),
            });
        }
        for symbol in file.symbols() {
            image.add_symbol(&file, &symbol);
        }
        image.end_functions();
        Ok(image)
    }

    fn add_symbol(&mut self, file: &File<'_>, symbol: &Symbol<'_, '_>) {
        let Ok(name) = symbol.name() else { return };
        let address = narrow(symbol.address());
        let section = symbol.section_index().and_then(|index| file.section_by_index(index).ok());
        // The texts of a log have symbols, too, but are not in memory.
        let loaded = section.is_some_and(|section| is_loaded(&section));
        if loaded && symbol.kind() == SymbolKind::Text {
            self.add_function(name, address & !1, narrow(symbol.size()));
        } else if loaded && (name.starts_with("$t") || name.starts_with("$d")) {
            self.code_begins.insert(address, name.starts_with("$t"));
        } else {
            if loaded && symbol.kind() == SymbolKind::Data {
                self.add_object(address, narrow(symbol.size()));
            }
            self.symbols.insert(name.to_owned(), address);
        }
    }

    fn add_function(&mut self, name: &str, address: u32, size: u32) {
        let function = self.functions.entry(address).or_default();
        function.names.push(names::as_in_source(name));
        function.end = function.end.max(address.saturating_add(size));
    }

    /// A variable without a size may have the address of another one.
    fn add_object(&mut self, address: u32, size: u32) {
        let known = self.objects.entry(address).or_default();
        *known = size.max(*known);
    }

    /// Symbols of hand-written functions may lack a size; such a function ends where the next
    /// begins.
    fn end_functions(&mut self) {
        let mut next = None;
        let pieces = &self.pieces;
        for (&address, function) in self.functions.iter_mut().rev() {
            if function.end == address {
                let piece = pieces.iter().find(|piece| piece.addresses().contains(&address));
                let end = piece.map_or(address, |piece| piece.addresses().end);
                function.end = next.map_or(end, |next: u32| next.min(end));
            }
            next = Some(address);
        }
    }

    /// The address that a symbol of the linker script stands for.
    pub(crate) fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Size of the variable that ends at an address.
    pub(crate) fn size_of_object_before(&self, end: u32) -> Option<u32> {
        let (&address, &size) = self.objects.range(..end).next_back()?;
        (address.checked_add(size) == Some(end)).then_some(size)
    }

    /// Address of a function.
    pub(crate) fn function(&self, name: &str) -> Option<u32> {
        let has_name =
            |(_, function): &(_, &Function)| function.names.iter().any(|known| known == name);
        self.functions.iter().find(has_name).map(|(&address, _)| address)
    }

    /// The function that contains an address, and its start.
    pub(crate) fn function_around(&self, address: u32) -> Option<(u32, &Function)> {
        let (&begin, function) = self.functions.range(..=address).next_back()?;
        (begin == address || address < function.end).then_some((begin, function))
    }

    /// The function that contains an address, as text.
    pub(crate) fn name_of(&self, address: u32) -> String {
        match self.function_around(address) {
            Some((begin, function)) if begin == address => function.name().to_owned(),
            Some((begin, function)) => format!("{}+{:#x}", function.name(), address - begin),
            None => format!("{address:#010x}"),
        }
    }

    /// Whether there is code at an address.
    pub(crate) fn is_code(&self, address: u32) -> bool {
        let piece = self.pieces.iter().find(|piece| piece.addresses().contains(&address));
        let mut begins =
            piece.into_iter().flat_map(|piece| self.code_begins.range(piece.address..=address));
        begins.next_back().is_some_and(|(_, code)| *code)
    }

    /// Where code begins again after the data at `address`.
    pub(crate) fn code_after(&self, address: u32) -> Option<u32> {
        self.code_begins.range(address..).find(|(_, code)| **code).map(|(&address, _)| address)
    }

    /// The bytes at an address, if the image holds them.
    pub(crate) fn bytes<const N: usize>(&self, address: u32) -> Option<[u8; N]> {
        let piece = self.pieces.iter().find(|piece| piece.addresses().contains(&address))?;
        let offset = usize::try_from(address - piece.address).ok()?;
        piece.bytes.get(offset..)?.first_chunk().copied()
    }

    /// The word at an address.
    pub(crate) fn word(&self, address: u32) -> Option<u32> {
        self.bytes(address).map(u32::from_le_bytes)
    }

    /// The stack pointer at reset, and the routines that the processor calls: the reset routine
    /// first, then the handlers.
    pub(crate) fn vectors(&self) -> Option<(u32, Vec<u32>)> {
        let table = self.pieces.iter().find(|piece| piece.name == VECTOR_TABLE)?;
        let mut words = table.bytes.as_chunks().0.iter().map(|&bytes| u32::from_le_bytes(bytes));
        let stack = words.next()?;
        Some((stack, words.filter(|&word| word != 0).map(|word| word & !1).collect()))
    }
}

/// Where cortex-m-rt puts the vector table.
pub(crate) const VECTOR_TABLE: &str = ".vector_table";

fn is_loaded(section: &Section<'_, '_>) -> bool {
    has_flag(section, SHF_ALLOC)
}

fn has_flag(section: &Section<'_, '_>, flag: object::elf::SectionFlags) -> bool {
    matches!(section.flags(), SectionFlags::Elf { sh_flags, .. } if sh_flags.contains(flag))
}

/// An address or size of a 32-bit processor.
fn narrow(value: u64) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

#[cfg(test)]
impl Image {
    /// Functions one after the other from `address`, in one piece of code.
    pub(crate) fn of_functions(address: u32, functions: &[(&str, &[u16])]) -> Image {
        let mut image = Image::default();
        let mut bytes = Vec::new();
        for (name, code) in functions {
            let begin = address + narrow(bytes.len() as u64);
            image.add_function(name, begin, narrow(code.len() as u64 * 2));
            image.code_begins.insert(begin, true);
            bytes.extend(code.iter().flat_map(|halfword| halfword.to_le_bytes()));
        }
        let size = narrow(bytes.len() as u64);
        image.pieces.push(Piece {
            name: ".text".to_owned(),
            address,
            size,
            bytes,
            writable: false,
        });
        image
    }

    /// An image of these pieces only.
    pub(crate) fn of_pieces(pieces: Vec<Piece>) -> Image {
        Image { pieces, ..Image::default() }
    }

    /// Adds a vector table.
    pub(crate) fn with_vectors(mut self, words: &[u32]) -> Image {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let size = narrow(bytes.len() as u64);
        let name = VECTOR_TABLE.to_owned();
        self.pieces.push(Piece { name, address: 0x4000_0000, size, bytes, writable: false });
        self
    }

    /// An image with the contents of both.
    pub(crate) fn joined_with(mut self, other: Image) -> Image {
        self.pieces.extend(other.pieces);
        self.functions.extend(other.functions);
        self.code_begins.extend(other.code_begins);
        self
    }

    /// Sets the place of the stack.
    pub(crate) fn with_stack(mut self, end: u32, start: u32) -> Image {
        self.symbols.extend([("_stack_end".to_owned(), end), ("_stack_start".to_owned(), start)]);
        self
    }

    /// Adds a variable.
    pub(crate) fn with_object(mut self, address: u32, size: u32) -> Image {
        self.add_object(address, size);
        self
    }

    /// Marks the bytes from `begin` to `end` as data.
    pub(crate) fn with_data(mut self, begin: u32, end: u32) -> Image {
        self.code_begins.insert(begin, false);
        self.code_begins.insert(end, true);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_function_without_a_size_ends_where_the_next_one_begins() {
        let mut image = Image::of_functions(0x100, &[("one", &[0; 4]), ("two", &[0; 2])]);
        image.add_function("inner", 0x104, 0);
        image.functions.get_mut(&0x108).unwrap().end = 0x108;
        image.end_functions();
        let ends: Vec<_> =
            image.functions.iter().map(|(&begin, function)| (begin, function.end)).collect();
        assert_eq!(ends, [(0x100, 0x108), (0x104, 0x108), (0x108, 0x10C)]);
    }

    #[test]
    fn a_variable_is_found_though_an_empty_one_has_its_address() {
        let image = Image::of_functions(0x100, &[]).with_object(0x200, 16).with_object(0x200, 0);
        assert_eq!(image.size_of_object_before(0x210), Some(16));
    }

    #[test]
    fn addresses_are_named_after_the_function_around_them() {
        let image = Image::of_functions(0x100, &[("one", &[0; 4]), ("two", &[0; 2])]);
        assert_eq!(image.name_of(0x108), "two");
        assert_eq!(image.name_of(0x106), "one+0x6");
        assert_eq!(image.name_of(0x200), "0x00000200");
        assert_eq!((image.function("two"), image.function("three")), (Some(0x108), None));
    }
}
