//! `demo`: the whole system, from a cold clone.

use std::ffi::OsString;

use crate::setup::demand::Installing;
use crate::steps::{self, Result};
use crate::{images, ser_cli};

const EXAMPLES: &str = "\
Examples:
  cargo xtask demo           with simulated recorders: needs Rust only
  cargo xtask demo --qemu    with the ARM image in QEMU; installs what is missing";

/// Play a breaker trip to two recorders, and report what happened.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Use the ARM image in QEMU as the first recorder.
    #[arg(long)]
    qemu: bool,

    /// Options of `ser-cli demo`.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<OsString>,
}

pub(crate) fn run(arguments: &Arguments, installing: Installing) -> Result<()> {
    let mut demo = ser_cli::command("demo");
    if arguments.qemu {
        demo.arg("--image").arg(images::build_emulated(installing)?);
    }
    ser_cli::build()?;
    steps::become_program(demo.args(&arguments.options))
}
