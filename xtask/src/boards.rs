//! The boards: what is built for them and what their images have to keep to.

use std::path::PathBuf;

use crate::places;
use crate::setup::cross::{self, Target};

const KIB: u32 = 1024;

/// A board and what is asked of its image.
#[derive(Clone, Debug)]
pub(crate) struct Board {
    pub(crate) name: &'static str,
    pub(crate) package: &'static str,
    pub(crate) target: Target,
    /// Bytes. Goals, below what the memory map has: an affordable controller with room for more.
    pub(crate) flash_budget: u32,
    /// Bytes of variables, with an event log of full size.
    pub(crate) variables_budget: u32,
    /// Where the memory with the stack begins. Below, the protection unit allows nothing: a stack that gets there
    /// ends in a fault.
    pub(crate) stack_floor: u32,
    /// Functions that go on while the flash is being erased, besides all interrupt handlers: they and all that they
    /// call have to be in RAM. None where nothing is erased.
    pub(crate) while_erasing: &'static [&'static str],
    /// Functions that end the program on purpose, each with the reason: they may panic, and have no bound for the
    /// stack.
    pub(crate) forced: &'static [(&'static str, &'static str)],
    /// The chip as probe-rs calls it; none on a board that is emulated.
    pub(crate) chip: Option<&'static str>,
}

/// The emulated board.
pub(crate) const MPS2_AN385: Board = Board {
    name: "mps2-an385",
    package: "ser-mps2-an385",
    target: cross::CORTEX_M3,
    flash_budget: 48 * KIB,
    variables_budget: 48 * KIB,
    stack_floor: 0x2000_0000,
    while_erasing: &[],
    forced: &[(
        "ser_mps2_an385::forced::force",
        "the bench sees how this very image ends when something goes wrong",
    )],
    chip: None,
};

/// The board to flash.
pub(crate) const STM32F407: Board = Board {
    name: "stm32f407",
    package: "ser-stm32f407",
    target: cross::CORTEX_M4F,
    flash_budget: 48 * KIB,
    variables_budget: 48 * KIB,
    stack_floor: 0x1000_0000,
    while_erasing: &["main"],
    forced: &[],
    chip: Some("STM32F407ZGTx"),
};

/// All of them.
pub(crate) const BOARDS: [Board; 2] = [MPS2_AN385, STM32F407];

impl Board {
    /// Where cargo puts the image.
    pub(crate) fn image(&self) -> PathBuf {
        places::firmware_target().join(self.target).join("release").join(self.package)
    }

    /// The board of this name.
    pub(crate) fn named(name: &str) -> Option<&'static Board> {
        const { &BOARDS }.iter().find(|board| board.name == name)
    }
}
