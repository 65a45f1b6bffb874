//! The emulator's plugin, which tells of each instruction of the image.

use std::path::PathBuf;

use crate::places;
use crate::setup::emulator;
use crate::steps::{self, Failure, Result, heading};

/// What QEMU loads to tell of instructions.
const PLUGIN: &str = "image-bench-plugin";

/// From this version on QEMU has plugins name the second version of its interface.
const SECOND_INTERFACE: u32 = 9;

/// Builds the emulator's plugin for the emulator that there is; gives its file.
pub(crate) fn build() -> Result<PathBuf> {
    if cfg!(not(target_os = "linux")) {
        return Err(Failure::new(
            "instructions are counted by a plugin of the emulator, which is built for Linux only",
        ));
    }
    heading("Plugin for the emulator");
    let interface = if emulator::major_version() < Some(SECOND_INTERFACE) { "1" } else { "2" };
    let mut build = steps::cargo();
    build.env("SER_QEMU_PLUGIN_API", interface).args(["build", "--release", "--package", PLUGIN]);
    steps::run(&mut build)?;
    Ok(places::host_target().join("release/libimage_bench_plugin.so"))
}
