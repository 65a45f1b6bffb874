//! The emulator's plugin, which reports each instruction of the image.

use std::path::PathBuf;

use crate::places;
use crate::setup::emulator;
use crate::steps::{self, Failure, Result, heading};

/// The package of the plugin.
const PLUGIN: &str = "image-bench-plugin";

/// The first version of QEMU with the second version of its plugin interface.
const SECOND_INTERFACE: u32 = 9;

/// Builds the plugin for the installed emulator and returns its path.
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
