//! The ARM image in QEMU: the emulator itself, the files and the external bus that it shares with
//! this process, and what the board shows there.

pub(crate) mod emulated_board;
pub(crate) mod emulator;
pub mod emulator_files;
pub mod external_bus;
pub mod process;
