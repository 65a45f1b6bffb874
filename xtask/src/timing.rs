//! `timing`: the instructions of the ARM image, counted in the emulator.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::setup::emulator;
use crate::steps::{self, Failure, Result, heading};
use crate::{firmware, places};

/// What QEMU loads to tell of instructions.
const PLUGIN: &str = "ser-qemu-plugin";

/// From this version on QEMU has plugins name the second version of its interface.
const SECOND_INTERFACE: u32 = 9;

/// Count the instructions of the ARM image in the emulator, hold them against the budgets, and account for every
/// event of a load.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    /// Options of the measurement; `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let image = firmware::build_emulated()?;
    let plugin = build_plugin()?;
    heading("Timing");
    let mut timing = steps::cargo();
    timing.args(["run", "--release", "--quiet", "-p", "ser-tests", "--bin", "timing", "--", "--image"]);
    timing.arg(image).arg("--plugin").arg(plugin).args(&arguments.options);
    steps::become_program(&mut timing)
}

/// Builds the emulator's plugin for the emulator that there is; gives its file.
pub(crate) fn build_plugin() -> Result<PathBuf> {
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
    Ok(places::host_target().join("release/libser_qemu_plugin.so"))
}
