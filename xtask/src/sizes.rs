//! What an image takes of the board's memories, from its section headers.

use std::fs;
use std::path::Path;

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{File, Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};

use crate::steps::{Failure, Result};

/// Bytes of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Sizes {
    /// Code, constants, and the first values of variables.
    pub(crate) flash: u64,
    pub(crate) variables: u64,
    /// What the memory map sets aside.
    pub(crate) stack: u64,
}

impl Sizes {
    pub(crate) fn of_image(path: &Path) -> Result<Sizes> {
        let fails = |error: &dyn std::fmt::Display| Failure::new(format!("{}: {error}", path.display()));
        let bytes = fs::read(path).map_err(|error| fails(&error))?;
        let file = File::parse(bytes.as_slice()).map_err(|error| fails(&error))?;
        let mut sizes = Sizes::default();
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
            if !sh_flags.contains(SHF_ALLOC) {
                continue;
            }
            if sh_flags.contains(SHF_WRITE) {
                sizes.variables += section.size();
            }
            if section.kind() != SectionKind::UninitializedData {
                sizes.flash += section.size();
            }
        }
        let address = |name| file.symbol_by_name(name).map_or(0, |symbol| symbol.address());
        sizes.stack = address("_stack_start").saturating_sub(address("_stack_end"));
        Ok(sizes)
    }
}
