//! The ARM image in QEMU: the emulator itself, the files and the external bus that it shares with
//! this process, and what the board shows there.

pub(crate) mod emulated_board;
pub(crate) mod emulator;
pub(crate) mod emulator_files;
pub(crate) mod external_bus;
