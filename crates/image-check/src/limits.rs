//! What the image of each board must comply with.

const KIB: u32 = 1024;

/// What the image of a board must comply with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The board's name.
    pub board: &'static str,
    /// Flash in bytes. The goal is below what the memory map has: an affordable controller with
    /// room for more.
    pub flash_budget: u32,
    /// Bytes of variables, with an event log of full size.
    pub variables_budget: u32,
    /// Where the memory with the stack begins. The protection unit allows no access below, so a
    /// stack that gets there ends in a fault.
    pub stack_floor: u32,
    /// Functions that run on while the flash is being erased, in addition to all interrupt
    /// handlers. They and everything that they call must be in RAM. Empty if nothing is erased.
    pub while_erasing: &'static [&'static str],
    /// Functions that end the program on purpose, each with the reason. They may panic and need no
    /// stack bound.
    pub forced: &'static [(&'static str, &'static str)],
}

/// The emulated board.
pub const MPS2_AN385: Limits = Limits {
    board: "mps2-an385",
    // With the commands beyond the manual, and what they keep and filter.
    flash_budget: 56 * KIB,
    variables_budget: 52 * KIB,
    stack_floor: 0x2000_0000,
    while_erasing: &[],
    forced: &[(
        "ser_mps2_an385::forced::force",
        "the bench sees how this very image ends when something goes wrong",
    )],
};

/// The board to flash.
pub const STM32F407: Limits = Limits {
    board: "stm32f407",
    // With the commands beyond the manual, and what they keep and filter.
    flash_budget: 56 * KIB,
    variables_budget: 52 * KIB,
    stack_floor: 0x1000_0000,
    while_erasing: &["main"],
    forced: &[],
};

/// The limits of all boards.
pub const ALL: [Limits; 2] = [MPS2_AN385, STM32F407];

impl Limits {
    /// The limits of the board with this name.
    #[must_use]
    pub fn of(board: &str) -> Option<&'static Limits> {
        const { &ALL }.iter().find(|limits| limits.board == board)
    }
}
