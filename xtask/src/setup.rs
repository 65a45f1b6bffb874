//! Finds the tools that do not come with Rust, and installs what is missing where that can be done unasked.

mod apt;
pub(crate) mod components;
pub(crate) mod cross;
pub(crate) mod emulator;
